"use strict";
// Poses as they come, each in a message of its own. The last ones are kept: they tell how large the room is.

const KEPT = 500; // frames
const LOOK_AGAIN = 25; // frames after which the room is measured again

class Live {
  constructor() {
    readColours();
    this.count = 0;
    this.seen = 0; // frames with a pose
    data.frames = KEPT;
    data.truth = null;
    data.points = new Int16Array(KEPT * POINTS * 3).fill(data.unseen);
    data.confidence = new Uint8Array(KEPT * data.joints.length);
    data.spread = new Int16Array(KEPT * data.joints.length * 6);
    data.status = new Uint8Array(KEPT).fill(data.statuses.indexOf("empty"));
    this.scene = new Scene(byId("scene"));
    optionsOf(this.scene);
    onRestyle(() => this.scene.draw(this.scene.frame));
    const socket = new WebSocket(`ws://${location.host}/poses`);
    socket.addEventListener("message", (event) => this.take(unpacked(JSON.parse(event.data))));
    socket.addEventListener("close", () => (byId("lost").textContent = "the session has ended"));
  }

  take(message) {
    const slot = this.count++ % KEPT;
    for (const key of ["points", "confidence", "spread", "status"]) {
      const size = data[key].length / KEPT;
      if (message[key] === null) data[key].fill(0, slot * size, (slot + 1) * size);
      else data[key].set(message[key], slot * size);
    }
    if (hasPose(slot)) this.measure();
    byId("readout").textContent = message.told;
    byId("lost").textContent = hasPose(slot) ? "" : `no pose: ${statusName(slot)}`;
    // Several messages may come between two pictures of the screen; only the last one is drawn.
    cancelAnimationFrame(this.next);
    this.next = requestAnimationFrame(() => {
      this.scene.draw(slot);
      document.documentElement.dataset.frame = message.number;
    });
  }

  // The room of the poses so far; the first one is looked at from ahead.
  measure() {
    if (this.seen++ % LOOK_AGAIN !== 0) return;
    this.scene.room = this.scene.extent();
    this.scene.orbit.home = this.scene.front();
    if (this.seen === 1) this.scene.orbit.reset();
  }
}

new Live();
