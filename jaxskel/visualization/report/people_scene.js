"use strict";
// The scene of several people: names, heads of their own colour, and a target in the middle of all.

Scene = class extends Scene {
  // Follows the middle of all who are shown.
  draw(frame) {
    const { follow } = this.options;
    const points = pointsOf(data.points, frame);
    const roots = people.map((_, who) => points[placeOf(who, 0)]).filter((point) => point !== null);
    if (follow && roots.length > 0) {
      this.orbit.target = [0, 1, 2].map((k) => roots.reduce((sum, root) => sum + root[k], 0) / roots.length);
    }
    this.options.follow = false;
    super.draw(frame);
    this.options.follow = follow;
  }

  // Each head has the colour of its person, whose name is above.
  drawJoints(points) {
    const { middle } = colours;
    people.forEach((person, who) => {
      const own = points.map(() => null);
      for (let point = 0; point < OWN; point++) own[placeOf(who, point)] = points[placeOf(who, point)];
      colours.middle = colours[hueOf(person)];
      super.drawJoints(own);
      const known = own.filter((point) => point !== null);
      if (known.length > 0) this.drawName(person, known.reduce((a, b) => (a[2] > b[2] ? a : b)));
    });
    colours.middle = middle;
  }

  drawName(person, [x, y, top]) {
    const dot = this.orbit.dot([x, y, top + 2 * BONE]);
    if (dot === null) return;
    this.pen.font = "600 13px system-ui, sans-serif";
    this.pen.textAlign = "center";
    // A rim keeps it legible over bones.
    this.pen.strokeStyle = colours.panel;
    this.pen.lineWidth = 3;
    this.pen.strokeText(person.name, dot.x, dot.y - 4);
    this.pen.fillStyle = colours[hueOf(person)];
    this.pen.fillText(person.name, dot.x, dot.y - 4);
    this.pen.textAlign = "start";
  }
};
