"use strict";
// What pages with a scene share: its check boxes, its button, and the theme.

function optionsOf(scene) {
  const boxes = { "show-truth": "truth", "show-spread": "spread", "show-cameras": "cameras", follow: "follow" };
  for (const [id, option] of Object.entries(boxes)) {
    byId(id).addEventListener("change", () => {
      scene.options[option] = byId(id).checked;
      scene.draw(scene.frame);
    });
  }
  document.querySelector(".with-truth").hidden = data.truth === null;
  document.querySelector(".with-spread").hidden = data.spread === null;
  byId("reset").addEventListener("click", () => {
    scene.orbit.reset();
    scene.draw(scene.frame);
  });
}

function onRestyle(redraw) {
  for (const query of ["(prefers-color-scheme: dark)", "print"]) {
    matchMedia(query).addEventListener("change", () => {
      readColours();
      redraw();
    });
  }
}
