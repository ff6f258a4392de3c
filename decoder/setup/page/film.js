// The filmstrip: the selected gauge in frames spread over the flight, the found needles drawn in, value and score.
import { byId, h, s } from "./dom.js";
import { valued } from "./following.js";
import { isDrawn, kindOf, needsMarks } from "./kinds.js";
import { inPagesWords } from "./words.js";

const DOUBTFUL_SCORE = 0.9;

const plain = (value, unit) => {
  const size = Math.abs(value);
  const places = size >= 1000 ? 0 : size >= 100 ? 1 : 2;
  return `${value.toFixed(places)}${unit ? ` ${unit}` : ""}`;
};

function hand(line, { size, half }, name) {
  const [[x1, y1], [x2, y2]] = line.map((end) => end.map((value) => size / 2 + (value * size) / (2 * half)));
  return s("line", { x1, y1, x2, y2, class: name });
}

function cell(frame, place, result) {
  const { size } = result.dial;
  const dial = h("div", { class: "dial" });
  const count = result.frames.length;
  dial.style.backgroundImage = `url("${result.film}")`;
  dial.style.backgroundSize = `${count * 100}% 100%`;
  dial.style.backgroundPosition = `${count > 1 ? (place / (count - 1)) * 100 : 0}% 0`;
  const drawing = s("svg", { viewBox: `0 0 ${size} ${size}`, "aria-hidden": "true" });
  const alone = frame.needles.filter(({ together }) => !together).map(({ name }) => name);
  const lines = frame.needles.map(({ name, status, value, text, score, line, together }) => {
    if (line) drawing.append(hand(line, result.dial, `shape needle ${alone.indexOf(name) % 2 ? "other" : ""}`));
    if (value === null) return h("p", {}, h("span", { class: "value missing" }, "missing"), h("span", { class: "score" }, score.toFixed(2)));
    const doubt = score < DOUBTFUL_SCORE || status !== "read" ? "doubt" : "";
    return h("p", { title: `${name}: ${status}`, class: together ? "together" : undefined }, h("span", { class: `value ${doubt}` }, text || plain(value, "")), h("span", { class: `score ${doubt}` }, score.toFixed(2)));
  });
  dial.append(drawing);
  const lost = frame.reason ? h("p", { class: "missing", title: frame.reason }, "not found") : null;
  return h("div", { class: `cell ${frame.reason ? "lost" : ""}`, role: "listitem" }, dial, h("p", { class: "number", title: `frame ${frame.index}` }, frame.index), ...lines, lost);
}

// What keeps a gauge from being read, in the words of its field.
function inWords(store, gauge, { error, problems = [] }) {
  const parts = (problems[0]?.path || "").split(/[.[\]]+/);
  const control = kindOf(store, gauge).controls.find(({ key }) => parts.includes(key));
  const words = inPagesWords(store, error, problems[0]?.path || "");
  return control && !/[A-Z`]/.test(error[0]) ? `${control.label} ${words}.` : words;
}

export function showFilm(store, live) {
  const root = byId("film");

  function say(words) {
    root.classList.remove("old");
    root.replaceChildren(h("p", { class: "blank" }, words));
  }

  function show() {
    const { kind, index } = store.selection;
    const { gauge } = store;
    if (kind !== "gauge" || !gauge) {
      say(store.document.gauges?.length ? "Select a gauge to see it read all through the flight." : "The gauges you draw are read here, in frames spread over the flight.");
      return;
    }
    const result = live.resultOf(index);
    if (!result && live.latest.has(index) && live.keyOf(index)) {
      root.classList.add("old");
      return;
    }
    if (!result) {
      const lacks = [
        !store.document.anchors?.length && "an anchor",
        !isDrawn(store, gauge) && kindOf(store, gauge).lacking,
        needsMarks(store, gauge) && valued(gauge.scale).length < 2 && "two tick marks with their values",
      ].filter(Boolean);
      say(lacks.length ? `To be read it still needs ${lacks.join(", ")}.` : "Reading …");
      return;
    }
    if (result.error) {
      say(inWords(store, gauge, result));
      return;
    }
    root.classList.remove("old");
    root.setAttribute("role", "list");
    root.setAttribute("aria-label", `${gauge.name} in ${result.frames.length} frames, ${gauge.unit || "no unit"}`);
    root.replaceChildren(...result.frames.map((frame, place) => cell(frame, place, result)));
  }

  store.on("change select trial", show);
  show();
}
