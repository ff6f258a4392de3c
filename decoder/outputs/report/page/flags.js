// The table of flags: a button leads to each, boxes leave kinds out.
import { byId } from "./dom.js";

export function useFlags(state) {
  const rows = [...document.querySelectorAll("#flags tbody tr")];
  for (const row of rows) {
    row.querySelector("button").addEventListener("click", () => {
      goTo(state, Number(row.dataset.first), Number(row.dataset.last), Number(row.dataset.needle));
      byId("data").scrollIntoView({ block: "start" });
    });
  }
  state.on("paper", showTable);
  const boxes = [...document.querySelectorAll("#kinds input")];
  const search = byId("flag-search");
  const texts = new Map();
  const textOf = (row) => texts.get(row) || texts.set(row, row.textContent.toLowerCase()).get(row);

  function choose() {
    const left = new Set(boxes.filter((box) => !box.checked).map((box) => box.value));
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      row.hidden = left.has(row.dataset.kind) || !words.every((word) => textOf(row).includes(word));
      shown += row.hidden ? 0 : 1;
    }
    byId("flag-count").textContent = shown < rows.length ? `${shown} of ${rows.length}` : "";
  }

  for (const box of boxes) box.addEventListener("change", choose);
  search.addEventListener("input", choose);
}

// Two thousand rows take a fifth of a second to lay out.
export function showTable() {
  const table = byId("flags");
  if (table) table.hidden = false;
}

// Looks at a span with as much again around it, and chooses the frame in its middle.
export function goTo(state, first, last, needle) {
  const times = state.flight.time_ms;
  const width = Math.max(times[last] - times[first], (state.all[1] - state.all[0]) / 200, 2000);
  const middle = (times[first] + times[last]) / 2;
  state.look(middle - width * 1.5, middle + width * 1.5);
  state.choose((first + last) >> 1, needle);
}

// The next flag after the chosen row, or the one before it.
export function nextFlag(state, direction) {
  const flags = state.flight.flags;
  const here = state.row;
  const middle = ([first, last]) => (first + last) >> 1;
  const beyond = flags.filter((flag) => flag[2] !== "phase" && (middle(flag) - here) * direction > 0);
  if (!beyond.length) return;
  const best = beyond.reduce((one, other) => ((middle(other) - middle(one)) * direction < 0 ? other : one));
  state.choose(middle(best), best[3]);
}
