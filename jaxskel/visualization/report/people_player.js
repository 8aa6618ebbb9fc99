"use strict";
// The player of several people: its legend switches each of them off and on.

Player = class extends Player {
  constructor() {
    super();
    const legend = document.querySelector(".scene figcaption");
    const bySide = this.option("left and right in colour", false, (checked) => this.colourSides(checked));
    bySide.querySelector("input").id = "by-side";
    legend.prepend(...people.map((person) => this.switchOf(person)), bySide);
    this.colourSides(false);
  }

  option(name, checked, change) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked });
    box.addEventListener("change", () => change(box.checked));
    label.append(box, ` ${name}`);
    return label;
  }

  // Switches a person off and on, in the scene and in the views.
  switchOf(person) {
    const label = this.option("", true, (checked) => {
      if (checked) shown.add(person);
      else shown.delete(person);
      gather();
      this.redraw();
    });
    label.className = "who";
    keyOf(person, label);
    return label;
  }

  colourSides(bySide) {
    paint(bySide);
    for (const key of document.querySelectorAll(".key.left, .key.right")) key.hidden = !bySide;
    this.redraw();
  }

  redraw() {
    this.scene.draw(this.frame);
    this.views.draw(this.frame);
    this.tellLost(this.frame);
  }

  show(frame) {
    super.show(frame);
    this.tellLost(frame);
  }

  tellLost(frame) {
    const told = [];
    for (const person of shown) {
      alone(person, () => hasPose(frame) || told.push(`${person.name}: no pose: ${statusName(frame)}`));
    }
    byId("lost").textContent = told.join(" · ");
  }
};
