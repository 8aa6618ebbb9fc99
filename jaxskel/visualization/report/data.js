"use strict";
// What the page knows: arrays of small whole numbers in base64, made by the package.

function decoded(text, Kind) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return new Kind(bytes.buffer);
}

const data = JSON.parse(document.getElementById("data").textContent);
const POINTS = data.parents.length;
for (const key of ["points", "truth", "spread", "starts", "skeletons"]) {
  data[key] = data[key] === null ? null : decoded(data[key], Int16Array);
}
for (const key of ["confidence", "side_confidence", "status"]) data[key] = decoded(data[key], Uint8Array);
data.steps = decoded(data.steps, Int8Array);
for (const key of ["counts", "lengths"]) data[key] = decoded(data[key], Uint32Array);
data.frame_index = decoded(data.frame_index, Float64Array);

const COLOURS = ["left", "right", "middle", "true", "person", "panel", "line", "soft", "text", "joint", "shadow"];
let colours = {};

// Canvases do not see the style sheet: its colours are read once for each theme.
function readColours() {
  const style = getComputedStyle(document.documentElement);
  colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const sideOf = [...data.joints, ...data.tips].map((name) =>
  name.startsWith("l_") ? "left" : name.startsWith("r_") ? "right" : "middle");

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
