"use strict";
// The views: silhouette and projected skeleton of every stride-th frame, as the cameras see them.

class Views {
  constructor(parent) {
    this.starts = this.firstOutlines();
    this.frame = 0;
    this.views = data.views.map((view, i) => {
      const figure = document.createElement("figure");
      const canvas = document.createElement("canvas");
      const caption = document.createElement("figcaption");
      caption.textContent = view.name;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `silhouette and skeleton in ${view.name}`);
      figure.append(canvas, caption);
      figure.addEventListener("click", () => {
        const was = figure.classList.contains("large");
        for (const other of parent.children) other.classList.remove("large");
        figure.classList.toggle("large", !was);
        this.layout();
      });
      parent.append(figure);
      new ResizeObserver(() => this.draw(this.frame)).observe(canvas);
      return { ...view, figure, canvas, window: this.windowOf(view, i) };
    });
    this.note = document.getElementById("thinned");
    this.note.hidden = data.stride === 1 && data.shown > 0;
    this.note.textContent = "The page has no room for silhouettes.";
    this.layout();
  }

  // Where the outlines of each shown frame and view begin: in the list of outlines and in that of steps.
  firstOutlines() {
    const starts = [];
    let [outline, step] = [0, 0];
    for (const count of data.counts) {
      starts.push([outline, step]);
      for (let i = 0; i < count; i++) step += 2 * (data.lengths[outline++] - 1);
    }
    return starts;
  }

  // Corners of the largest outline of a view in a frame: the person, not a blob. Nothing where there is none.
  largestOutline(slot) {
    let [outline, at] = this.starts[slot];
    let [corners, largest] = [[], 0];
    for (let i = 0; i < data.counts[slot]; i++, outline++) {
      let [x, y] = [data.starts[2 * outline], data.starts[2 * outline + 1]];
      let [left, top, right, bottom] = [x, y, x, y];
      for (let more = data.lengths[outline] - 1; more > 0; more--) {
        x += data.steps[at++];
        y += data.steps[at++];
        [left, top, right, bottom] = [Math.min(left, x), Math.min(top, y), Math.max(right, x), Math.max(bottom, y)];
      }
      const area = (right - left) * (bottom - top);
      if (area > largest) [corners, largest] = [[[left, top], [right, bottom]], area];
    }
    return corners;
  }

  // The part of an image, in steps of the display, in which person and skeleton ever are; all of it without any.
  windowOf(view, i) {
    const whole = [0, 0, view.size[0] * view.scale, view.size[1] * view.scale];
    let box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let shown = 0; shown < data.shown; shown++) {
      const slot = shown * data.views.length + i;
      const points = this.largestOutline(slot);
      for (let at = 2 * POINTS * slot; at < 2 * POINTS * (slot + 1); at += 2) {
        points.push([data.skeletons[at], data.skeletons[at + 1]]);
      }
      for (const [x, y] of points) {
        if (x === data.unseen || x < 0 || y < 0 || x > whole[2] || y > whole[3]) continue;
        box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
      }
    }
    if (box[0] > box[2]) return whole;
    const margin = 0.06 * Math.max(box[2] - box[0], box[3] - box[1]);
    return [box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin];
  }

  // Small views show a window on the person, all of one shape; an enlarged one shows the whole image.
  layout() {
    const shapes = this.views.map(({ window: [left, top, right, bottom] }) => (right - left) / (bottom - top));
    const shape = Math.max(0.7, Math.min(4 / 3, shapes.reduce((a, b) => a + b) / shapes.length));
    for (const view of this.views) {
      const [width, height] = view.size.map((side) => side * view.scale);
      const [left, top, right, bottom] = view.window;
      if (view.figure.classList.contains("large")) {
        view.shown = { left: 0, top: 0, width, shape: width / height };
      } else {
        const wide = Math.max(right - left, shape * (bottom - top));
        view.shown = { left: (left + right - wide) / 2, top: (top + bottom - wide / shape) / 2, width: wide, shape };
      }
      view.canvas.style.aspectRatio = view.shown.shape;
    }
    this.draw(this.frame);
  }

  draw(frame) {
    this.frame = frame;
    const shown = Math.min(Math.floor(frame / data.stride), data.shown - 1);
    if (shown < 0) return;
    this.note.textContent = `To keep the page small, the views show one frame of ${data.stride}: here frame `
      + `${shown * data.stride}.`;
    this.views.forEach((view, i) => {
      const { pen, width } = fitted(view.canvas);
      if (width === 0) return;
      // From steps of the display to pixels of this canvas. The outline runs half a pixel inside where it is straight
      // along the image, a third where it is slanted: a line of nine tenths of a pixel makes up for it.
      const scale = width / view.shown.width;
      const slot = shown * data.views.length + i;
      const [dx, dy] = [-scale * view.shown.left, -scale * view.shown.top];
      pen.translate(dx, dy);
      pen.fillStyle = colours.panel;
      pen.fillRect(0, 0, scale * view.size[0] * view.scale, scale * view.size[1] * view.scale);
      this.silhouette(pen, slot, scale, Math.max(1, 0.9 * scale * view.scale));
      this.skeleton(pen, slot, scale, Math.max(2, width / 110));
      Object.assign(view.canvas.dataset, { frame: shown * data.stride, scale: scale * view.scale, dx, dy });
    });
  }

  silhouette(pen, slot, scale, pixel) {
    let [outline, at] = this.starts[slot];
    pen.beginPath();
    for (let i = 0; i < data.counts[slot]; i++, outline++) {
      let [x, y] = [data.starts[2 * outline], data.starts[2 * outline + 1]];
      pen.moveTo(scale * x, scale * y);
      for (let left = data.lengths[outline] - 1; left > 0; left--) {
        x += data.steps[at++];
        y += data.steps[at++];
        pen.lineTo(scale * x, scale * y);
      }
      pen.closePath();
    }
    pen.fillStyle = pen.strokeStyle = colours.person;
    pen.lineWidth = pixel;
    pen.fill("evenodd");
    pen.stroke();
  }

  skeleton(pen, slot, scale, width) {
    const at = (joint) => {
      const start = 2 * (slot * POINTS + joint);
      if (joint < 0 || data.skeletons[start] === data.unseen) return null;
      return [scale * data.skeletons[start], scale * data.skeletons[start + 1]];
    };
    pen.lineWidth = width;
    for (let joint = 0; joint < POINTS; joint++) {
      const [a, b] = [at(joint), at(data.parents[joint])];
      if (a === null || b === null) continue;
      pen.strokeStyle = colours[sideOf[joint]];
      pen.beginPath();
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
    }
    pen.fillStyle = colours.joint;
    for (let joint = 0; joint < data.joints.length; joint++) {
      const a = at(joint);
      if (a === null) continue;
      pen.beginPath();
      pen.arc(...a, 0.7 * width, 0, 2 * Math.PI);
      pen.fill();
    }
  }
}
