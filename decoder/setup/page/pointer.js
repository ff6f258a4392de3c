// The pointer on the panel picture: click with a tool, drag what is drawn, pan what is not.
import { gaugeAt } from "./dials.js";
import { around } from "./geometry.js";
import { click } from "./tools.js";

const STILL_PX = 4;

export function followPointer(store, view, overlay) {
  const { svg } = view;
  let press = null;

  // What was clicked on: a thing that is drawn, or else the gauge within which the click lies.
  function choose(grip, point) {
    const isPart = grip && (grip.selection.kind !== "gauge" || Object.keys(grip.selection).length > 2);
    const index = isPart ? undefined : gaugeAt(store, point);
    if (index === undefined) {
      if (grip) store.select(grip.selection);
    } else if (store.selection.kind !== "gauge" || store.selection.index !== index || grip) store.select({ kind: "gauge", index });
  }

  svg.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    svg.focus({ preventScroll: true });
    const grip = store.tool === "select" && event.button === 0 ? overlay.gripOf(event.target) : null;
    press = { grip, from: view.at(event), x: event.clientX, y: event.clientY, moved: false, pans: event.button === 1 };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });

  svg.addEventListener("pointermove", (event) => {
    const point = view.at(event);
    if (store.tool !== "select") {
      store.cursor = point;
      store.tell("cursor");
    }
    if (!press) return;
    if (!press.moved && Math.hypot(event.clientX - press.x, event.clientY - press.y) < STILL_PX) return;
    if (!press.moved && press.grip) store.select(press.grip.selection);
    press.moved = true;
    if (press.grip?.drag) {
      store.held = point;
      store.tell("cursor");
      store.change(`drag ${JSON.stringify(press.grip.selection)} ${press.x} ${press.y}`, (document) => {
        press.grip.drag(document, point, press.from);
      });
    } else if (store.tool === "select" || press.pans) {
      svg.classList.add("panning");
      view.pan(event.movementX, event.movementY);
    }
  });

  svg.addEventListener("pointerup", async (event) => {
    const { grip, from, moved, pans } = press || {};
    press = null;
    if (store.held) {
      store.held = null;
      store.tell("cursor");
    }
    svg.classList.remove("panning");
    if (from === undefined || pans) return;
    if (store.tool === "select") {
      if (!moved) choose(grip, from);
      return;
    }
    if (moved && store.tool === "anchor" && !store.clicks.length) await click(store, from);
    await click(store, view.at(event));
  });

  svg.addEventListener("dblclick", (event) => {
    const place = store.tool === "select" && store.gauge ? around(store.gauge) : null;
    if (place) view.closeUp(...place);
    event.preventDefault();
  });
}
