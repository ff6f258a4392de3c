// The keyboard: everything the pointer can do.
import { nextFlag } from "./flags.js";

export function useKeys(state) {
  const step = (rows) => () => state.choose(state.row + rows);
  const keys = {
    ArrowLeft: step(-1),
    ArrowRight: step(1),
    "Shift+ArrowLeft": step(-10),
    "Shift+ArrowRight": step(10),
    Home: () => state.choose(0),
    End: () => state.choose(state.flight.rows - 1),
    n: () => nextFlag(state, 1),
    p: () => nextFlag(state, -1),
    "+": () => state.zoom(0.5),
    "-": () => state.zoom(2),
    ",": () => state.pan(-0.25),
    ".": () => state.pan(0.25),
    0: () => state.lookAtAll(),
    d: () => state.toggleDrawing(),
    v: () => document.getElementById("film")?.click(),
    f: () => document.getElementById("fold").click(),
  };
  const shifted = { "=": "+", _: "-" };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input:not([type=checkbox]), select, textarea")) return;
    const plain = shifted[event.key] || (event.key.length === 1 ? event.key.toLowerCase() : event.key);
    const act = keys[event.shiftKey && plain.startsWith("Arrow") ? `Shift+${plain}` : plain];
    if (!act) return;
    event.preventDefault();
    act();
  });
  for (const button of document.querySelectorAll("button[data-key]")) {
    button.addEventListener("click", () => keys[button.dataset.key]());
  }
}
