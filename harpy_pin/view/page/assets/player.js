// One time for scenes, charts and labels. "replay" is what pictures, films and tests drive the page by.
async function start() {
  const content = await unpack(PACKED);
  const duration = content.duration, begin = content.runs[0].start;
  find("scenes").dataset.count = content.runs.length;
  const set_values = fill_labels(content);
  const scenes = content.runs.map(make_scene);
  const slider = find("time"), moves = scenes.some((scene) => scene.moves);
  let now = 0, playing = false, before = 0, speed = 1;
  const charts = make_charts(content, seek);
  slider.max = duration;

  function show(time) {
    now = Math.max(0, Math.min(duration, time));
    const rows = scenes.map((scene) => scene.seek(now));
    set_values(rows[0]);
    charts.set_time(now);
    slider.value = now;
    find("clock").textContent = (begin + now).toFixed(2) + " s";
  }
  // At rest the scene and all numbers are of the same instant, that of a frame.
  function seek(time) {
    pause();
    const frames = content.charts.frames, row = row_at(frames, time), next = Math.min(row + 1, frames.length - 1);
    show(frames[frames[next] - time < time - frames[row] ? next : row]);
  }
  function pause() {
    playing = false;
    find("play").textContent = "►";
    page.dataset.state = "paused";
  }
  function play() {
    if (!moves) return;
    if (now >= duration - 1e-6) show(0);
    playing = true;
    find("play").textContent = "❚❚";
    page.dataset.state = "playing";
  }
  function follow_clock(instant) {
    requestAnimationFrame(follow_clock);
    // A tab in the background stands still; so does the replay in it.
    const passed = Math.min((instant - before) / 1000, 0.2);
    before = instant;
    if (playing) show(now + speed * passed > duration ? 0 : now + speed * passed);
  }

  find("play").addEventListener("click", () => (playing ? seek(now) : play()));
  slider.addEventListener("input", () => seek(Number(slider.value)));
  find("speed").addEventListener("change", (event) => { speed = Number(event.target.value); });
  find("moment").textContent = "⚑ " + (begin + content.moment.time).toFixed(2) + " s: " + content.moment.reason;
  find("moment").title = find("moment").textContent;
  find("moment").addEventListener("click", () => seek(content.moment.time));
  find("fold").addEventListener("click", () => document.body.classList.toggle("folded"));
  window.addEventListener("keydown", (event) => {
    if (event.target.tagName === "SELECT") return;
    if (event.code === "Space") { event.preventDefault(); if (playing) seek(now); else play(); }
    if (event.code === "ArrowLeft" || event.code === "ArrowRight") {
      event.preventDefault();
      const frames = content.charts.frames, row = row_at(frames, now) + (event.code === "ArrowLeft" ? -1 : 1);
      seek(frames[Math.max(0, Math.min(frames.length - 1, row))]);
    }
  });

  // "#t=2.1" opens the page at 2.1 s, "#play" playing from the start; "&still" hides controls and charts, "&bare" words, too.
  const wish = new URLSearchParams(location.hash.slice(1));
  if (wish.has("still")) document.body.classList.add("still");
  if (wish.has("bare")) document.body.classList.add("bare");
  seek(wish.has("t") ? Number(wish.get("t")) - begin : wish.has("play") ? 0 : content.moment.time);
  if (!moves) find("bar").style.display = "none";
  window.replay = {
    content, scenes, charts, play, pause,
    get time() { return now; },
    show(time) { pause(); show(time); for (const scene of scenes) scene.viewer.render(); },
  };
  page.dataset.opened = performance.now().toFixed(0);  // ms since the address was entered
  page.dataset.frames = content.runs[0].time.length;
  if (!moves || wish.has("still")) page.dataset.state = "still";
  requestAnimationFrame(follow_clock);
  if (wish.has("play")) requestAnimationFrame(() => requestAnimationFrame(play));
}

start();
