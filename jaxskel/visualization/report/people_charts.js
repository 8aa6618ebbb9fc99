"use strict";
// The charts of several people: the status of everybody, and the curves of one who is chosen.

class Band extends Charts {
  row(title, className) {
    const row = super.row("", className);
    keyOf(people.find(({ name }) => name === data.name), row.label);
    return row;
  }

  chart() {}

  ticks() {}
}

class Curves extends Charts {
  band() {}
}

Charts = class {
  constructor(parent, seek) {
    this.parts = people.map((person) => {
      const part = { person };
      alone(person, () => (part.band = new Band(parent, seek)));
      return part;
    });
    parent.append(this.chooser());
    for (const part of this.parts) {
      part.block = document.createElement("div");
      parent.append(part.block);
      alone(part.person, () => (part.curves = new Curves(part.block, seek)));
    }
    this.choose(0);
  }

  chooser() {
    const row = document.createElement("div");
    row.className = "row chooser";
    const label = document.createElement("label");
    label.className = "label";
    const select = document.createElement("select");
    select.id = "chosen";
    people.forEach(({ name }, who) => select.add(new Option(name, who)));
    select.addEventListener("change", () => this.choose(Number(select.value)));
    label.append("curves of ", select);
    row.append(label);
    return row;
  }

  choose(chosen) {
    this.parts.forEach(({ block }, who) => (block.hidden = who !== chosen));
  }

  show(frame) {
    for (const { person, band, curves } of this.parts) {
      alone(person, () => {
        band.show(frame);
        curves.show(frame);
      });
    }
  }
};
