"use strict";
// Data of several people: those of everybody as one skeleton with many roots, and those of one person alone.

const people = data.people.map(unpacked);
const JOINTS = data.joints.length / people.length; // of one person
const OWN = POINTS / people.length; // joints and tips of one person
const HUES = 8; // colours in the style sheet
const shown = new Set(people);
const sides = [...sideOf];

const hueOf = (person) => `body-${people.indexOf(person) % HUES}`;
COLOURS.push(...Array.from({ length: HUES }, (_, hue) => `body-${hue}`));

// Where a point of a person is among those of everybody: the joints of all come before the tips of all.
function placeOf(who, point) {
  return point < JOINTS ? who * JOINTS + point : (people.length - 1) * JOINTS + who * (OWN - JOINTS) + point;
}

// Numbers of everybody in each of some rows, so many for each point; of those who are not shown they are all the same.
function together(key, rows, points, width, hidden) {
  const Kind = people.map((person) => person[key]).find((numbers) => numbers !== null)?.constructor;
  if (Kind === undefined) return null;
  const all = new Kind(rows * people.length * points * width).fill(hidden);
  people.forEach((person, who) => {
    if (!shown.has(person) || person[key] === null) return;
    for (let row = 0; row < rows; row++) {
      for (const [first, end] of [[0, JOINTS], [JOINTS, points]]) {
        if (first === end) continue;
        const own = person[key].subarray(width * (row * points + first), width * (row * points + end));
        all.set(own, width * (row * people.length * points + placeOf(who, first)));
      }
    }
  });
  return all;
}

function gather() {
  data.points = together("points", data.frames, OWN, 3, data.unseen);
  data.skeletons = together("skeletons", data.counts.length, OWN, 2, data.unseen);
  data.confidence = together("confidence", data.frames, JOINTS, 1, 0);
  data.spread = together("spread", data.frames, JOINTS, 6, 0);
}

// The first view of the scene is that of the first person.
data.status = people[0].status;
gather();

// Bones have the colour of the person, or of their side.
function paint(bySide) {
  people.forEach((person, who) => {
    for (let point = 0; point < OWN; point++) {
      const place = placeOf(who, point);
      sideOf[place] = bySide ? sides[place] : hueOf(person);
    }
  });
}

// Does something with the data of one person in place of everybody's.
function alone(person, act) {
  const all = { ...data };
  Object.assign(data, person, { joints: all.joints.slice(0, JOINTS) });
  act();
  Object.assign(data, all);
}

// A name with its colour.
function keyOf(person, parent) {
  const key = document.createElement("span");
  key.className = "key";
  key.style.setProperty("--key", `var(--${hueOf(person)})`);
  key.textContent = person.name;
  parent.append(key);
}
