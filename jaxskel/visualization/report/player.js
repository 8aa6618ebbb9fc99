"use strict";
// One time for everything on the page: play, scrub, keys.

class Player {
  constructor() {
    readColours();
    this.frame = -1;
    this.playing = false;
    this.scene = new Scene(byId("scene"));
    this.views = new Views(byId("views"));
    this.charts = new Charts(byId("time"), (frame) => this.go(frame));
    byId("scrub").max = data.frames - 1;
    byId("scrub").addEventListener("input", () => this.go(Number(byId("scrub").value)));
    byId("play").addEventListener("click", () => this.toggle());
    byId("speed").addEventListener("change", () => this.begin());
    optionsOf(this.scene);
    document.addEventListener("keydown", (event) => this.key(event));
    onRestyle(() => {
      this.scene.draw(this.frame);
      this.views.draw(this.frame);
    });
    // "#35" at the end of the address opens the page at frame 35.
    const open = () => this.go(/^#\d+$/.test(location.hash) ? Number(location.hash.slice(1)) : Math.max(0, this.frame));
    addEventListener("hashchange", open);
    open();
  }

  // Someone chose a frame: playing goes on from there.
  go(frame) {
    this.show(Math.max(0, Math.min(data.frames - 1, frame)));
    this.begin();
  }

  show(frame) {
    if (frame === this.frame) return;
    this.frame = frame;
    this.scene.draw(frame);
    this.views.draw(frame);
    this.charts.show(frame);
    byId("scrub").value = frame;
    const number = data.frame_index[frame];
    byId("readout").textContent = `frame ${frame} of ${data.frames} · ${(frame / data.fps).toFixed(2)} s`
      + (number === frame ? "" : ` · number ${number} of the material`);
    byId("lost").textContent = hasPose(frame) ? "" : `no pose: ${statusName(frame)}`;
    document.documentElement.dataset.frame = frame;
  }

  toggle() {
    this.playing = !this.playing;
    byId("play").textContent = this.playing ? "❚❚" : "▶";
    byId("play").setAttribute("aria-label", this.playing ? "pause" : "play");
    this.begin();
    cancelAnimationFrame(this.next);
    if (this.playing) this.next = requestAnimationFrame((now) => this.tick(now));
  }

  begin() {
    this.origin = { frame: this.frame, time: performance.now() };
  }

  // The frame that belongs to this moment, whatever the rate of the screen is.
  tick(now) {
    const passed = Math.max(0, now - this.origin.time) / 1000 * data.fps * Number(byId("speed").value);
    this.show((this.origin.frame + Math.floor(passed)) % data.frames);
    this.next = requestAnimationFrame((later) => this.tick(later));
  }

  key(event) {
    const kind = event.target.tagName;
    // Buttons and lists have keys of their own.
    if (event.ctrlKey || event.altKey || event.metaKey || kind === "SELECT") return;
    if (event.key === " " && (kind === "BUTTON" || event.target.type === "checkbox")) return;
    const step = event.shiftKey ? 10 : 1;
    const moves = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.go(this.frame - step),
      ArrowRight: () => this.go(this.frame + step),
      Home: () => this.go(0),
      End: () => this.go(data.frames - 1),
    };
    if (!(event.key in moves)) return;
    event.preventDefault();
    moves[event.key]();
  }
}
