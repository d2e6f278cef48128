// Charts over time, all with the same span of time and the same moment marked.
const HEIGHT = 96, LEAST_SPAN = 0.05;

function make_charts(content, on_seek) {
  const { time, frames, charts } = content.charts;
  const end = Math.max(content.duration, time[time.length - 1], 1e-3);
  const view = { min: 0, max: end }, made = [];
  let now = 0;
  const groups = new Map();
  const phone = window.matchMedia("(max-width: 820px)").matches;
  for (const chart of charts) {
    if (!groups.has(chart.group)) {
      const group = make("details"), summary = make("summary", chart.group);
      group.open = !phone || groups.size === 0;
      if (groups.size === 0) summary.append(zoom_buttons());
      group.append(summary);
      find("charts").append(group);
      groups.set(chart.group, group);
    }
    made.push(make_chart(chart, groups.get(chart.group)));
  }

  function zoom_buttons() {
    const box = make("span", "zoom", "zoom");
    for (const [text, title, act] of [
      ["+", "zoom in (Ctrl and wheel)", () => zoom(0.5, now)], ["−", "zoom out", () => zoom(2, now)],
      ["↔", "the whole run", () => zoom(Infinity, now)]]) {
      const button = make("button", text);
      button.type = "button";
      button.title = title;
      button.addEventListener("click", (event) => { event.preventDefault(); act(); });
      box.append(button);
    }
    return box;
  }

  // Stretch the span of time by a factor about a moment, which stays where it is.
  function zoom(factor, about) {
    const span = Math.min(Math.max((view.max - view.min) * factor, LEAST_SPAN), end);
    const share = (about - view.min) / (view.max - view.min);
    look_at(about - Math.min(Math.max(share, 0), 1) * span, span);
  }
  function look_at(begin, span) {
    view.min = Math.max(0, Math.min(begin, end - span));
    view.max = view.min + span;
    for (const one of made) one.plot.setScale("x", { min: view.min, max: view.max });
    set_time(now);
  }

  function set_time(t) {
    now = t;
    const span = view.max - view.min;
    if (t < view.min - 1e-9 || t > view.max + 1e-9) { look_at(t - 0.1 * span, span); return; }
    const row = row_at(frames, t);
    for (const one of made) one.mark(t, row);
  }

  function make_chart(chart, group) {
    const box = make("div", "", "chart"), title = make("p"), place = make("div", "", "plot");
    title.append(make("b", chart.title + " (" + chart.unit + ")"));
    const outputs = [];
    for (const line of chart.lines) {
      const label = make("span"), swatch = make("i", "", line.filled ? "filled" : line.dashed ? "dashed" : "");
      const value = make("output");
      swatch.style.borderTopColor = line.colour;
      label.append(swatch, line.label, value);
      title.append(label);
      outputs.push(value);
    }
    box.append(title, place);
    group.append(box);
    const options = {
      width: 300, height: HEIGHT, legend: { show: false }, cursor: { show: false }, padding: [4, 8, 0, 0],
      scales: { x: { time: false, range: () => [view.min, view.max] }, y: { range: (u, low, high) => bounds(chart, low, high) } },
      axes: [
        { size: 20, font: "10px system-ui", stroke: "#6b7786", grid: { stroke: "#e6ebf1" }, ticks: { size: 3 }, gap: 2 },
        { size: 42, font: "10px system-ui", stroke: "#6b7786", grid: { stroke: "#e6ebf1" }, ticks: { size: 3 }, gap: 3, space: 22 },
      ],
      series: [{}].concat(chart.lines.map((line) => ({
        stroke: line.colour, width: line.filled ? 0.5 : 1.3, dash: line.dashed ? [4, 3] : undefined,
        fill: line.filled ? line.colour + "55" : undefined, fillTo: 0, points: { show: false }, spanGaps: false,
      }))),
      hooks: { draw: [(u) => draw_level(u, chart.level)] },
    };
    const plot = new uPlot(options, [time].concat(chart.lines.map((line) => line.values)), place);
    const head = make("div", "", "head");
    plot.over.append(head);
    plot.over.addEventListener("pointerdown", (event) => {
      plot.over.setPointerCapture(event.pointerId);
      on_seek(plot.posToVal(event.offsetX, "x"));
    });
    plot.over.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) on_seek(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
    });
    plot.over.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, plot.posToVal(event.offsetX, "x"));
    }, { passive: false });
    plot.over.addEventListener("dblclick", () => zoom(Infinity, now));
    new ResizeObserver(() => {
      if (place.clientWidth > 40 && place.clientWidth !== plot.width) {
        plot.setSize({ width: place.clientWidth, height: HEIGHT });
        set_time(now);
      }
    }).observe(place);
    return {
      plot,
      mark(t, row) {
        // Not valToPos: a new span takes effect in the plot only later.
        const place = (t - view.min) / (view.max - view.min) * plot.over.clientWidth;
        head.style.transform = "translateX(" + place + "px)";
        chart.lines.forEach((line, k) => {
          const value = line.shown[row];
          outputs[k].textContent = value === null ? "–" : Math.abs(value) < 5e-4 ? "0" : Number(value.toPrecision(3)).toString();
        });
      },
    };
  }
  return { set_time, plots: made.map((one) => one.plot) };
}

function bounds(chart, low, high) {
  if (low === null || high === null) { low = 0; high = 1; }
  if (chart.level !== null) { low = Math.min(low, chart.level.value); high = Math.max(high, chart.level.value); }
  const room = 0.06 * (high - low) || 0.5;
  return [chart.low ?? low - room, chart.high ?? high + room];
}

// A dashed line across a chart, with what it stands for.
function draw_level(u, level) {
  if (level === null) return;
  const y = u.valToPos(level.value, "y", true), { left, top, width, height } = u.bbox, ratio = devicePixelRatio;
  if (y < top - 1 || y > top + height + 1) return;
  const pen = u.ctx;
  pen.save();
  pen.strokeStyle = pen.fillStyle = "#b3261e";
  pen.lineWidth = ratio;
  pen.setLineDash([5 * ratio, 4 * ratio]);
  pen.beginPath();
  pen.moveTo(left, y);
  pen.lineTo(left + width, y);
  pen.stroke();
  pen.font = 10 * ratio + "px system-ui";
  pen.textAlign = "right";
  pen.textBaseline = y - top > 14 * ratio ? "bottom" : "top";
  pen.setLineDash([]);
  pen.lineWidth = 3 * ratio;
  pen.strokeStyle = "#ffffffcc";
  pen.strokeText(level.label, left + width - 3 * ratio, y - 1);
  pen.fillText(level.label, left + width - 3 * ratio, y - 1);
  pen.restore();
}
