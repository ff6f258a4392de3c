// The evidence: the gauges as they are in the picture of the chosen frame, and over them where the needles were found.
import { percentText, shares } from "./budget.js";
import { byId, h, s } from "./dom.js";
import { enlarge, useEnlarged } from "./enlarge.js";
import { durationText, frameText, secondsText, spreadText, utcText, valueText } from "./words.js";

export function showEvidence(state) {
  const { flight } = state;
  const sources = new Map([...document.querySelectorAll("script.evidence")].map((each) => [Number(each.dataset.row), each]));
  const rows = [...sources.keys()].sort((one, other) => one - other);

  function nearest(row) {
    const apart = (other) => Math.abs(flight.time_ms[other] - flight.time_ms[row]);
    return rows.reduce((best, other) => (best < 0 || apart(other) < apart(best) ? other : best), -1);
  }

  let shown = null;

  function large() {
    if (!shown || shown.found.trouble) return;
    const { found, row } = shown;
    const shapes = state.drawing ? (found.gauges || []).flatMap((gauge) => drawing(flight, gauge, row)) : [];
    enlarge(`Frame ${flight.frame[row]} · ${utcText(flight, row)}`, found, shapes);
  }

  function show() {
    const { row } = state;
    if (row < 0) return;
    const pictured = sources.has(row) ? row : nearest(row);
    byId("evidence-title").textContent = `Frame ${flight.frame[row]}`;
    byId("evidence-time").textContent = `${utcText(flight, row)} · ${secondsText(flight, row)}`;
    byId("evidence-values").replaceChildren(...flight.needles.map((needle) => reading(flight, needle, row)));
    const remark = byId("evidence-remark");
    remark.hidden = pictured === row;
    const found = pictured < 0 ? null : JSON.parse(sources.get(pictured).textContent);
    if (pictured < 0) remark.textContent = "This report holds no pictures.";
    else if (pictured !== row) {
      const apart = flight.time_ms[pictured] - flight.time_ms[row];
      remark.textContent = `No pictures of this frame are in the report. Shown is the nearest that has some: ${frameText(flight, pictured)}, ${durationText(apart)} ${apart < 0 ? "before" : "after"}, with its own values.`;
    }
    shown = found && { found, row: pictured };
    byId("evidence-strip").replaceChildren(...(found ? figures(state, found, pictured, large) : []));
    const strip = byId("evidence-strip");
    const asked = strip.querySelector(".asked");
    strip.scrollLeft = asked ? asked.offsetLeft - (strip.clientWidth - asked.clientWidth) / 2 : 0;
    byId("evidence").dataset.row = String(row);
    byId("evidence").dataset.pictured = String(pictured);
  }

  state.on("row", show);
  useEnlarged(state, large);
  show();
  byId("drawing").addEventListener("change", () => state.toggleDrawing());
  state.on("row", () => (byId("drawing").checked = state.drawing));
  byId("fold").addEventListener("click", () => fold(!byId("evidence").classList.contains("folded")));

  function fold(folded) {
    byId("evidence").classList.toggle("folded", folded);
    byId("fold").textContent = folded ? "Show pictures" : "Fold";
    byId("fold").setAttribute("aria-expanded", String(!folded));
  }
}

function figures(state, found, row, large) {
  const { flight } = state;
  const reason = flight.lost[row];
  if (found.trouble) return [h("p", { class: "blank" }, `The picture of this frame could not be drawn: ${found.trouble}`)];
  if (found.whole) {
    const words = reason ? `Not read: ${reason}` : "The whole frame";
    return [h("figure", { class: "whole" }, picture(found.whole, [], words, large), h("figcaption", {}, words))];
  }
  return found.gauges.map((gauge) => {
    const needles = gauge.needles.map(({ at }) => flight.needles[at]);
    const names = needles.map((needle) => `${needle.name} ${valueText(needle, row)}`).join(", ");
    const asked = gauge.needles.some(({ at }) => at === state.needle);
    return h("figure", { "data-gauge": gauge.name, class: asked ? "asked" : undefined },
      picture(gauge.jpeg ? gauge : { box: gauge.box, of: found.frame }, state.drawing ? drawing(flight, gauge, row) : [], `${gauge.name} in ${frameText(flight, row)}: ${names}`, large),
      h("figcaption", {}, ...needles.map((needle) => reading(flight, needle, row))));
  });
}

// A part of a frame: its own picture, or what the whole frame's shows there.
function picture({ box, jpeg, of }, shapes, words, large) {
  const [left, top, width, height] = of ? of.box : box;
  const onkeydown = (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault(); // or it would press the button that then has the focus
    large();
  };
  return s("svg", { viewBox: box.join(" "), role: "img", "aria-label": `${words}; Enter shows the whole frame`, tabindex: "0", onclick: large, onkeydown },
    s("image", { href: `data:image/jpeg;base64,${jpeg || of.jpeg}`, x: left, y: top, width, height, preserveAspectRatio: "none" }),
    ...shapes);
}

// The rim thin, each needle as a thin line so that its own pixels stay in sight, and a mark outside where it points.
function drawing(flight, gauge, row) {
  const { rim, pivot, needles } = gauge;
  const radius = Math.hypot(rim[0] - pivot[0], rim[1] - pivot[1]);
  const made = [s("polygon", { points: pairs(rim), class: "rim", "stroke-width": radius / 70 })];
  for (const { at, line } of needles) {
    if (!line) continue;
    const status = flight.statuses[flight.needles[at].status[row]];
    const [, , x, y] = line;
    const along = (part) => [pivot[0] + (x - pivot[0]) * part, pivot[1] + (y - pivot[1]) * part];
    made.push(
      s("polyline", { points: pairs(line), class: `needle ${status}`, "stroke-width": radius / 36 }),
      s("polyline", { points: pairs([...along(1.03), ...along(1.17)]), class: "cap", "stroke-width": radius / 9 }),
      s("polyline", { points: pairs([...along(1.03), ...along(1.17)]), class: `needle ${status}`, "stroke-width": radius / 14 }),
    );
  }
  return made;
}

const pairs = (flat) => flat.map((value, at) => (at % 2 ? `${value} ` : `${value},`)).join("").trim();

// One value with how it came about.
function reading(flight, needle, row) {
  const status = flight.statuses[needle.status[row]];
  const score = needle.score[row];
  return h("div", { class: "reading" },
    h("span", { class: "name" }, needle.name),
    h("span", { class: "value" }, valueText(needle, row), " ", h("small", {}, spreadText(needle, row))),
    h("span", { class: "note" }, h("i", { class: `dot ${status}`, "aria-hidden": "true" }), status, Number.isFinite(score) ? ` · score ${score.toFixed(3)}` : ""),
    ...why(flight, needle, row));
}

const opened = new Set(); // of which needles people read it from frame to frame

// What its uncertainty is made of, to be opened.
function why(flight, needle, row) {
  const causes = shares(flight, needle, row);
  if (!causes.length) return [];
  const items = causes.map(([words, , part]) => h("li", {}, h("b", {}, percentText(part)), ` ${words}`));
  const ontoggle = (event) => (event.target.open ? opened.add(needle.name) : opened.delete(needle.name));
  return [h("details", { class: "why", open: opened.has(needle.name) || undefined, ontoggle }, h("summary", {}, "why"), h("ul", {}, ...items))];
}
