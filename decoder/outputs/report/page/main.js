// Puts the page together once all of it is there.
import { byId } from "./dom.js";
import { loadFlight } from "./columns.js";
import { drawCharts } from "./charts.js";
import { useCompare } from "./compare.js";
import { useDownload } from "./download.js";
import { showEvidence } from "./evidence.js";
import { showTable, useFlags } from "./flags.js";
import { useFilm } from "./film.js";
import { useKeys } from "./keys.js";
import { useNotes } from "./notes.js";
import { TimePlot } from "./plot.js";
import { State } from "./state.js";
import { checkTrack, errorTrack, needleTrack } from "./tracks.js";
import { durationText, spreadText, utcText, valueText } from "./words.js";

const flight = loadFlight();
const state = new State(flight);

const plots = [...document.querySelectorAll("[data-plot]")].map((host) => {
  const at = Number(host.dataset.at);
  const track = { needle: () => needleTrack(flight, at), error: () => errorTrack(flight, at), alignment: () => flight.alignment[at], check: () => checkTrack(flight, at) };
  return new TimePlot(host, state, track[host.dataset.plot]);
});

function tellValues() {
  const { row } = state;
  for (const place of document.querySelectorAll("[data-value]")) {
    const needle = flight.needles[Number(place.dataset.value)];
    place.textContent = row < 0 ? "" : `${valueText(needle, row)} ${spreadText(needle, row)}`;
  }
}

function tellView() {
  const [from, to] = state.view;
  byId("view").textContent = flight.rows ? `${durationText(to - from)} in view` : "";
}

state.on("row", tellValues);
state.on("view", tellView);
useFlags(state);
useKeys(state);
useFilm(state);
useCompare(state);
useDownload(state);
useNotes(state);
tellView();

// Another width or another scheme: the plots are drawn anew; on paper all of them, at once.
for (const [what, event] of [[matchMedia("(prefers-color-scheme: dark)"), "style"], [matchMedia("print"), "paper"]]) {
  what.addEventListener("change", () => state.tell(event));
}
addEventListener("resize", () => state.tell("style"));
addEventListener("beforeprint", () => state.tell("paper"));
addEventListener("afterprint", () => state.tell("style"));

const [first, last, , needle] = flight.flags[0] || [0, 0, "", -1];
state.choose((first + last) >> 1, needle);

// The curves are drawn while the pictures below are still being read; what is out of sight waits until all that is in sight is there.
const pictures = new Promise((done) => addEventListener("DOMContentLoaded", done)).then(() => showEvidence(state));
Promise.all([pictures, ...plots.map((plot) => plot.seen)]).then(() =>
  requestAnimationFrame(() => setTimeout(() => {
    document.body.dataset.ready = "";
    requestIdleCallback(showRest, { timeout: 1000 });
  })),
);

function showRest() {
  showTable();
  drawCharts(state);
}
