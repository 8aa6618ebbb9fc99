"use strict";
// What the page knows: arrays of small whole numbers in base64, made by the package.

function decoded(text, Kind) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return new Kind(bytes.buffer);
}

const KINDS = {
  points: Int16Array, truth: Int16Array, spread: Int16Array, starts: Int16Array, skeletons: Int16Array,
  confidence: Uint8Array, side_confidence: Uint8Array, status: Uint8Array, steps: Int8Array,
  counts: Uint32Array, lengths: Uint32Array, frame_index: Float64Array,
};

// The same numbers, with their arrays as arrays; null stays null.
function unpacked(numbers) {
  for (const [key, Kind] of Object.entries(KINDS)) {
    if (typeof numbers[key] === "string") numbers[key] = decoded(numbers[key], Kind);
  }
  return numbers;
}

const byId = (id) => document.getElementById(id);
const data = unpacked(JSON.parse(byId("data").textContent));
const POINTS = data.parents.length;

const COLOURS = ["left", "right", "middle", "true", "person", "panel", "line", "soft", "text", "joint", "shadow"];
let colours = {};

// Canvases do not see the style sheet: its colours are read once for each theme.
function readColours() {
  const style = getComputedStyle(document.documentElement);
  colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const sideOf = [...data.joints, ...data.tips].map((name) =>
  name.startsWith("l_") ? "left" : name.startsWith("r_") ? "right" : "middle");

// A left joint and the right one that tell where the front is: hips, or else any; none where nothing has two sides.
function acrossOf() {
  const lefts = data.joints.filter((name) => name.startsWith("l_") && data.joints.includes(`r_${name.slice(2)}`));
  const name = lefts.includes("l_hip") ? "l_hip" : lefts[0];
  return name === undefined ? [] : [name, `r_${name.slice(2)}`].map((each) => data.joints.indexOf(each));
}

const hasPose = (frame) => data.with_pose.includes(data.status[frame]);
const statusName = (frame) => data.statuses[data.status[frame]];

// The points of a frame in metres, z up; null for one that is not known.
function pointsOf(steps, frame) {
  const found = [];
  for (let i = 0; i < POINTS; i++) {
    const at = 3 * (frame * POINTS + i);
    found.push(steps[at] === data.unseen ? null : [0, 1, 2].map((k) => data.origin[k] + data.step * steps[at + k]));
  }
  return found;
}

// The Cholesky factor (m) of a joint's covariance, z up: its three rows; null where it is not known.
function spreadOf(frame, joint) {
  const at = 6 * (frame * data.joints.length + joint);
  const [a, b, c, d, e, f] = data.spread.subarray(at, at + 6);
  if (a === 0) return null;
  return [[a, 0, 0], [b, c, 0], [d, e, f]].map((row) => row.map((x) => x * data.spread_step));
}

// A canvas with as many pixels as the screen has there; drawing is in CSS pixels.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineCap = pen.lineJoin = "round";
  return { pen, width, height };
}
