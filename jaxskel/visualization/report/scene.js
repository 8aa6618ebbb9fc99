"use strict";
// The skeleton in 3D: floor, shadow, cameras, bones, and how far each joint may be off.

const BONE = data.bone; // m, width of a bone
const GRID = 0.5; // m between the lines of the floor

const between = (start, end, share) => start.map((x, k) => x + share * (end[k] - x));

class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.frame = 0;
    this.room = this.extent();
    this.orbit = new Orbit(this.front());
    this.options = { truth: false, cameras: true, follow: false, spread: true };
    this.orbit.attach(canvas, () => this.draw(this.frame));
    new ResizeObserver(() => this.draw(this.frame)).observe(canvas);
  }

  // The box of all points. The floor is where the feet are lowest, but for one frame in fifty, which may be wrong.
  extent() {
    const lowest = [];
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let frame = 0; frame < data.frames; frame++) {
      const points = pointsOf(data.points, frame).filter((point) => point !== null);
      if (points.length === 0) continue;
      lowest.push(Math.min(...points.map((point) => point[2])));
      for (const point of points) {
        for (let k = 0; k < 3; k++) [low[k], high[k]] = [Math.min(low[k], point[k]), Math.max(high[k], point[k])];
      }
    }
    if (lowest.length === 0) return { low: [-1, -1, 0], high: [1, 1, 2], floor: 0 };
    lowest.sort((a, b) => a - b);
    return { low, high, floor: lowest[Math.floor(lowest.length / 50)] };
  }

  // Looks at the subject of the first pose from ahead and a little aside.
  front() {
    const { low, high, floor } = this.room;
    const [left, right] = acrossOf();
    let azimuth = -Math.PI / 3;
    for (let frame = 0; left !== undefined && frame < data.frames; frame++) {
      if (!hasPose(frame)) continue;
      const points = pointsOf(data.points, frame);
      const [x, y] = [0, 1].map((k) => points[left][k] - points[right][k]);
      azimuth = Math.atan2(-x, y) + 0.5;
      break;
    }
    const target = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (floor + high[2]) / 2];
    const radius = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - floor) / 2;
    return { azimuth, elevation: 0.22, distance: 1.9 * SPREAD * radius + 0.3, target };
  }

  draw(frame) {
    this.frame = frame;
    const { pen, width, height } = fitted(this.canvas);
    if (width === 0) return;
    this.pen = pen;
    this.orbit.frame(width, height);
    const points = pointsOf(data.points, frame);
    if (this.options.follow && points[0] !== null) this.orbit.target = [...points[0]];
    this.drawFloor();
    if (this.options.cameras) data.cameras.forEach((centre, i) => this.drawCamera(centre, data.axes[i]));
    const bones = this.bones(points);
    this.shadow(bones);
    bones.sort((a, b) => b.depth - a.depth);
    for (const { joint, ends } of bones) {
      // A joint that is hardly sure fades; a tip is as sure as its joint.
      const of = joint < data.joints.length ? joint : data.parents[joint];
      const sure = data.confidence[frame * data.joints.length + of] / 255;
      // What lies behind is cut off, but not the bones that meet at a joint: the rim leaves out both ends.
      this.pen.lineCap = "butt";
      this.stroke([between(...ends, 0.25), between(...ends, 0.75)], colours.panel, BONE * 13 / 9, 1);
      this.pen.lineCap = "round";
      this.stroke(ends, colours[sideOf[joint]], BONE, 0.25 + 0.75 * sure);
    }
    // Over the bones, because good ones would hide it.
    if (this.options.truth && data.truth !== null) {
      for (const { ends } of this.bones(pointsOf(data.truth, frame))) this.stroke(ends, colours.true, BONE / 3, 1);
    }
    if (this.options.spread && data.spread !== null) this.drawSpread(points, frame);
    this.drawJoints(points);
    // For tests, and for whoever wants to know what is shown.
    Object.assign(this.canvas.dataset, {
      frame, azimuth: this.orbit.azimuth, elevation: this.orbit.elevation, distance: this.orbit.distance,
      target: JSON.stringify(this.orbit.target),
    });
  }

  bones(points) {
    const found = [];
    points.forEach((point, joint) => {
      const start = points[data.parents[joint]];
      if (point === null || start === undefined || start === null) return;
      const depth = (this.orbit.seen(point).depth + this.orbit.seen(start).depth) / 2;
      found.push({ joint, ends: [start, point], depth });
    });
    return found;
  }

  // A line in space, so many metres wide.
  stroke([start, end], colour, metres, alpha) {
    const line = this.orbit.line(start, end);
    if (line === null) return;
    this.pen.globalAlpha = alpha;
    this.trace(line, colour, Math.max(1, metres * (line[0].scale + line[1].scale) / 2));
    this.pen.globalAlpha = 1;
  }

  trace([a, b], colour, width) {
    this.pen.strokeStyle = colour;
    this.pen.lineWidth = width;
    this.pen.beginPath();
    this.pen.moveTo(a.x, a.y);
    this.pen.lineTo(b.x, b.y);
    this.pen.stroke();
  }

  thin(start, end, colour, width = 1) {
    const line = this.orbit.line(start, end);
    if (line !== null) this.trace(line, colour, width);
  }

  shadow(bones) {
    const lines = bones.map(({ ends }) => this.orbit.line(...ends.map(([x, y]) => [x, y, this.room.floor])));
    const seen = lines.filter((line) => line !== null);
    if (seen.length === 0) return;
    // In one stroke, because the colour is translucent.
    this.pen.beginPath();
    for (const [a, b] of seen) {
      this.pen.moveTo(a.x, a.y);
      this.pen.lineTo(b.x, b.y);
    }
    this.pen.strokeStyle = colours.shadow;
    this.pen.lineWidth = BONE * seen[0][0].scale;
    this.pen.stroke();
  }

  // The ellipsoids of two standard deviations, as seen from here.
  drawSpread(points, frame) {
    points.slice(0, data.joints.length).forEach((point, joint) => {
      const dot = point === null ? null : this.orbit.dot(point);
      const factor = dot === null ? null : spreadOf(frame, joint);
      if (factor === null) return;
      const [x, y] = [this.orbit.right, this.orbit.up].map((axis) =>
        [0, 1, 2].map((k) => axis[0] * factor[0][k] + axis[1] * factor[1][k] + axis[2] * factor[2][k]));
      const dots = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      const [xx, xy, yy] = [dots(x, x), dots(x, y), dots(y, y)];
      const [half, apart] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
      const sizes = [half + apart, half - apart].map((each) => 2 * dot.scale * Math.sqrt(Math.max(0, each)));
      this.pen.beginPath();
      // The canvas counts y downwards.
      this.pen.ellipse(dot.x, dot.y, ...sizes, -0.5 * Math.atan2(2 * xy, xx - yy), 0, 2 * Math.PI);
      this.pen.fillStyle = colours[sideOf[joint]];
      this.pen.globalAlpha = 0.2;
      this.pen.fill();
      // The rim shows where the ellipsoid is smaller than the bone is wide.
      this.pen.globalAlpha = 0.6;
      this.pen.strokeStyle = colours.text;
      this.pen.lineWidth = 1;
      this.pen.stroke();
      this.pen.globalAlpha = 1;
    });
  }

  drawJoints(points) {
    points.slice(0, data.joints.length).forEach((point, joint) => {
      const dot = point === null ? null : this.orbit.dot(point);
      if (dot === null) return;
      this.pen.fillStyle = colours.joint;
      this.pen.beginPath();
      // The head is a ball of a head's size, drawn as a ring, so that the bone shows.
      const head = data.joints[joint] === "head";
      this.pen.arc(dot.x, dot.y, Math.max(1.5, 0.4 * BONE * dot.scale), 0, 2 * Math.PI);
      this.pen.fill();
      if (!head) return;
      this.pen.beginPath();
      this.pen.arc(dot.x, dot.y, BONE / 0.45 * dot.scale, 0, 2 * Math.PI);
      this.pen.strokeStyle = colours.middle;
      this.pen.lineWidth = 2;
      this.pen.stroke();
    });
  }

  drawFloor() {
    const { low, high, floor } = this.room;
    const [from, to] = [0, 1].map((end) => [0, 1].map((k) =>
      GRID * (end === 0 ? Math.floor(low[k] / GRID - 1) : Math.ceil(high[k] / GRID + 1))));
    for (let x = from[0]; x <= to[0] + 1e-9; x += GRID) this.thin([x, from[1], floor], [x, to[1], floor], colours.line);
    for (let y = from[1]; y <= to[1] + 1e-9; y += GRID) this.thin([from[0], y, floor], [to[0], y, floor], colours.line);
    // One metre of the up axis, at a corner.
    const [foot, top] = [[...from, floor], [...from, floor + 1]];
    this.thin(foot, top, colours.soft, 2);
    const dot = this.orbit.dot(top);
    if (dot === null) return;
    this.pen.fillStyle = colours.soft;
    this.pen.font = "12px system-ui, sans-serif";
    this.pen.fillText(`${data.up}, 1 m`, dot.x + 5, dot.y + 4);
  }

  drawCamera(centre, [right, low, forward]) {
    const corner = (a, b) => centre.map((x, k) => x + 0.12 * a * right[k] + 0.09 * b * low[k] + 0.22 * forward[k]);
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    corners.forEach((point, i) => {
      this.thin(centre, point, colours.soft);
      this.thin(point, corners[(i + 1) % 4], colours.soft);
    });
  }
}
