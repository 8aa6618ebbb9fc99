"use strict";
// A pinhole camera that circles a point: angles in radians, metres, z up.
// The scene is drawn on a 2D canvas: some sixty lines a frame need no WebGL. Without a GPU, on two busy cores, Plotly's
// 3D scatter redrew such a skeleton 14 to 23 times a second and a canvas 27 to 60 times, in headless Chromium in three
// settings. Plotly adds 4.8 MB to each page, and Chromium has announced the end of WebGL without a GPU.

const NEAR = 0.05; // m: what is closer to the camera, or behind it, is cut off
const SPREAD = 1.6; // focal length in units of the shorter side of the canvas: 35 degrees

class Orbit {
  constructor(home) {
    this.home = home;
    this.reset();
  }

  reset() {
    Object.assign(this, this.home, { target: [...this.home.target] });
    this.turn();
  }

  turn() {
    this.elevation = Math.max(-0.2, Math.min(Math.PI / 2, this.elevation));
    this.distance = Math.max(0.3, Math.min(100, this.distance));
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    this.right = [-sa, ca, 0];
    this.up = [-se * ca, -se * sa, ce];
    this.toward = [ce * ca, ce * sa, se]; // from the target to the camera
  }

  frame(width, height) {
    [this.width, this.height, this.focal] = [width, height, SPREAD * Math.min(width, height)];
  }

  seen(point) {
    const from = point.map((x, k) => x - this.target[k]);
    const along = (axis) => axis[0] * from[0] + axis[1] * from[1] + axis[2] * from[2];
    return { x: along(this.right), y: along(this.up), depth: this.distance - along(this.toward) };
  }

  onCanvas({ x, y, depth }) {
    const scale = this.focal / depth;
    return { x: this.width / 2 + scale * x, y: this.height / 2 - scale * y, depth, scale };
  }

  // Both ends of a line on the canvas, cut where it runs behind the camera; null if all of it does.
  line(start, end) {
    let [a, b] = [this.seen(start), this.seen(end)];
    if (a.depth < NEAR && b.depth < NEAR) return null;
    if (b.depth < NEAR) [a, b] = [b, a];
    if (a.depth < NEAR) {
      const t = (b.depth - NEAR) / (b.depth - a.depth);
      a = { x: b.x + t * (a.x - b.x), y: b.y + t * (a.y - b.y), depth: NEAR };
    }
    return [this.onCanvas(a), this.onCanvas(b)];
  }

  dot(point) {
    const seen = this.seen(point);
    return seen.depth < NEAR ? null : this.onCanvas(seen);
  }

  // Dragging orbits, with shift (or the other buttons) moves the target; the wheel zooms.
  attach(canvas, redraw) {
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = event;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (last === null) return;
      const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
      if (event.shiftKey || event.buttons > 1) {
        const metres = this.distance / this.focal;
        this.target = this.target.map((x, k) => x - metres * (dx * this.right[k] - dy * this.up[k]));
      } else {
        this.azimuth -= 0.008 * dx;
        this.elevation += 0.008 * dy;
      }
      last = event;
      this.turn();
      redraw();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (last = null));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.distance *= Math.exp(0.0012 * Math.max(-200, Math.min(200, event.deltaY)));
      this.turn();
      redraw();
    }, { passive: false });
  }
}
