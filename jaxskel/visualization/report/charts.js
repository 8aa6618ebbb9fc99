"use strict";
// Curves over time and the band of statuses, as SVG: they stretch with the page and take its colours.

const COLUMNS = 1500; // a longer recording is drawn by the least and the greatest of each column

function svg(tag, attributes, parent) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  parent.append(node);
  return node;
}

// Values run from LOW to HIGH, which leaves room for the width of the line.
const [LOW, HIGH] = [0.94, 0.06];

// The path of values over frames, broken where one is null.
function pathOf(values, low, high) {
  const y = (value) => (LOW + (HIGH - LOW) * (Math.min(Math.max(value, low), high) - low) / (high - low)).toFixed(4);
  const group = Math.max(1, Math.ceil(values.length / COLUMNS));
  let [path, pen] = ["", "M"];
  for (let start = 0; start < values.length; start += group) {
    const known = values.slice(start, start + group).filter((value) => value !== null);
    if (known.length === 0) {
      pen = "M";
      continue;
    }
    const [x, least] = [(start + 0.5).toFixed(1), y(known.reduce((a, b) => Math.min(a, b)))];
    // A frame between two gaps is a short stroke.
    path += `${pen}${x} ${least}`;
    path += group > 1 ? `L${x} ${y(known.reduce((a, b) => Math.max(a, b)))}` : pen === "M" ? "h.3" : "";
    pen = "L";
  }
  return path;
}

class Charts {
  constructor(parent, seek) {
    [this.parent, this.seek, this.rows] = [parent, seek, []];
    this.band();
    const of = (make) => Array.from({ length: data.frames }, (_, frame) => (hasPose(frame) ? make(frame) : null));
    const n = data.joints.length;
    const confidence = of((frame) => Array.from(data.confidence.subarray(frame * n, frame * n + n), (c) => c / 255));
    this.chart("confidence of the joints", 0, 1, "", [
      ["mean", "mean", confidence.map((all) => all && all.reduce((a, b) => a + b) / n)],
      ["lowest", "worst", confidence.map((all) => all && Math.min(...all))],
    ]);
    if (data.spread !== null) this.deviations(of);
    this.chart("left and right", 0.5, 1, "", [["confidence", "side", of((frame) => data.side_confidence[frame] / 255)]]);
    if (data.truth !== null) {
      this.millimetres("distance from the truth", of((frame) => this.distances(frame)));
    }
    this.ticks();
  }

  // The root mean square of a joint's three standard deviations.
  deviations(of) {
    const size = (factor) => 1000 * Math.hypot(...factor.flat()) / Math.sqrt(3);
    this.millimetres("standard deviation of the joints", of((frame) => {
      const factors = data.joints.map((_, joint) => spreadOf(frame, joint));
      return factors.includes(null) ? null : factors.map(size);
    }));
  }

  // Mean and greatest of the joints' values.
  millimetres(title, values) {
    const worst = values.map((all) => all && Math.max(...all));
    // To the least round number that holds all but a few frames; the others run along the top.
    const sorted = worst.filter((value) => value !== null).sort((a, b) => a - b);
    const most = sorted.length ? sorted[Math.floor(0.98 * (sorted.length - 1))] : 1;
    this.chart(title, 0, [20, 50, 100, 200, 500, 1000].find((top) => top >= most) || 2000, " mm", [
      ["mean", "mean", values.map((all) => all && all.reduce((a, b) => a + b) / all.length)], ["worst", "worst", worst],
    ]);
  }

  distances(frame) {
    const [points, truth] = [data.points, data.truth].map((steps) => {
      const all = pointsOf(steps, frame);
      return data.truth_joints.map((joint) => all[joint]);
    });
    if (truth.length === 0 || truth.includes(null)) return null;
    return points.map((point, i) => 1000 * Math.hypot(...point.map((x, k) => x - truth[i][k])));
  }

  row(title, className) {
    const row = document.createElement("div");
    row.className = "row";
    const label = document.createElement("div");
    label.className = "label";
    label.textContent = title;
    const plot = document.createElement("div");
    plot.className = "plot";
    row.append(label, plot);
    this.parent.append(row);
    const chart = svg("svg", { viewBox: `0 0 ${data.frames} 1`, preserveAspectRatio: "none", class: className }, plot);
    const go = (event) => {
      const box = chart.getBoundingClientRect();
      this.seek(Math.floor(data.frames * (event.clientX - box.left) / box.width));
    };
    chart.addEventListener("pointerdown", (event) => {
      chart.setPointerCapture(event.pointerId);
      go(event);
    });
    chart.addEventListener("pointermove", (event) => event.buttons && go(event));
    return { label, plot, chart };
  }

  addCursor(chart, update) {
    const cursor = svg("line", { class: "cursor", y1: 0, y2: 1 }, chart);
    this.rows.push((frame) => {
      for (const end of ["x1", "x2"]) cursor.setAttribute(end, frame + 0.5);
      update(frame);
    });
  }

  chart(title, low, high, unit, series) {
    const { label, plot, chart } = this.row(title, "curves");
    for (const y of [LOW, 0.5, HIGH]) svg("line", { x1: 0, x2: data.frames, y1: y, y2: y }, chart);
    for (const [, kind, values] of series) svg("path", { class: kind, d: pathOf(values, low, high) }, chart);
    for (const [end, value] of [["low", low], ["high", high]]) {
      const text = document.createElement("span");
      text.className = `scale ${end}`;
      text.textContent = `${value}${unit}`;
      plot.append(text);
    }
    const notes = series.map(([name, kind, values]) => {
      const note = document.createElement("small");
      note.className = `swatch ${kind}`;
      label.append(note);
      return [note, name, values];
    });
    this.addCursor(chart, (frame) => {
      for (const [note, name, values] of notes) {
        const value = values[frame];
        note.textContent = `${name} ${value === null ? "–" : value.toFixed(unit ? 1 : 2) + unit}`;
      }
    });
  }

  band() {
    const { label, chart } = this.row("status", "band");
    const note = document.createElement("small");
    label.append(note);
    const kind = (frame) => (hasPose(frame) ? `status-${data.status[frame]}` : "lost");
    const runs = [];
    for (let start = 0, end = 0; start < data.frames; start = end) {
      while (end < data.frames && data.status[end] === data.status[start]) end++;
      runs.push([start, end]);
    }
    // What is worse lies on top, and a single frame of a long recording is still wide enough to be seen.
    runs.sort(([a], [b]) => data.status[a] - data.status[b]);
    for (const [start, end] of runs) {
      const width = Math.max(end - start, data.frames / 800);
      const run = svg("rect", { class: kind(start), x: start, y: 0, width, height: 1 }, chart);
      svg("title", {}, run).textContent = `${statusName(start)}: frames ${start} to ${end - 1}`;
    }
    this.addCursor(chart, (frame) => {
      note.className = `swatch ${kind(frame)}`;
      note.textContent = statusName(frame);
    });
  }

  // Seconds below the curves, at most ten of them.
  ticks() {
    const seconds = data.frames / data.fps;
    const every = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600].find((step) => seconds / step <= 10) || 1800;
    const row = document.createElement("div");
    row.className = "row";
    const ticks = document.createElement("div");
    ticks.className = "ticks";
    for (let i = 1; i * every < seconds; i++) {
      const tick = document.createElement("span");
      tick.textContent = `${+(i * every).toFixed(1)} s`;
      tick.style.left = `${(100 * (i * every * data.fps + 0.5)) / data.frames}%`;
      ticks.append(tick);
    }
    row.append(document.createElement("div"), ticks);
    this.parent.append(row);
  }

  show(frame) {
    for (const update of this.rows) update(frame);
  }
}
