// One run in three dimensions: a Meshcat viewer whose time is set from outside.
const WIDEST = 0.72;  // a pane narrower than this share of its height shows the robot smaller, instead of cut off

function make_scene(run) {
  const figure = make("figure", "", "scene"), caption = make("figcaption"), pane = make("div", "", "pane");
  caption.style.borderTopColor = run.colour;
  const status = make("span");
  caption.append(make("b", run.name), status);
  figure.append(caption, pane);
  find("scenes").append(figure);

  const viewer = new MeshCat.Viewer(pane);
  const set_size = viewer.set_3d_pane_size;
  viewer.set_3d_pane_size = () => {
    const width = Math.max(pane.clientWidth, 1), height = Math.max(pane.clientHeight, 1);
    viewer.camera.zoom = Math.min(1, width / height / WIDEST);
    set_size.call(viewer, width, height);
  };
  for (const command of run.commands) viewer.handle_command_bytearray(bytes_of(command));
  load_animation(viewer, run);
  new ResizeObserver(() => { viewer.set_3d_pane_size(); viewer.render(); }).observe(pane);
  viewer.set_3d_pane_size();

  const last = run.time[run.time.length - 1];
  return {
    viewer, run,
    moves: run.time.length > 1,
    seek(time) {
      viewer.animator.seek(Math.min(time + SAME, last));
      const row = row_at(run.time, time), over = time > last + SAME && run.ending !== "completed";
      const used = run.values.friction;
      status.textContent = over ? run.ending : used ? "friction used: " + used[row] : "";
      status.className = over ? "bad" : "";
      return row;
    },
  };
}

// Keyframes were packed as 32-bit floats; a still track has one row.
function load_animation(viewer, run) {
  if (run.time.length < 2) return;
  const times = Float32Array.from(run.time), clips = new Map();
  for (const track of run.tracks) {
    const values = new Float32Array(bytes_of(track.values).buffer);
    if (!clips.has(track.path)) clips.set(track.path, []);
    clips.get(track.path).push({
      name: "." + track.name, type: track.kind, times: track.still ? times.slice(0, 1) : times,
      values: track.kind === "boolean" ? Array.from(values, Boolean) : values,
    });
  }
  const animations = [];
  for (const [path, tracks] of clips)
    animations.push({ path: path.split("/").filter((name) => name), clip: { fps: 1, name: "default", tracks } });
  viewer.set_animation(animations, { play: true, repetitions: Infinity });
  viewer.animator.pause();
}
