// The inspector's fields of a gauge's needles, and the needles that are proposed.
import { h } from "./dom.js";
import { choice, details, field, input } from "./fields.js";
import { rounded } from "./geometry.js";
import { addNeedle, makeCoarser, remove, renameNeedle } from "./items.js";
import { scalePart } from "./scale_part.js";
import { lookForNeedles, offersOn } from "./offers.js";
import { axisAt, pick } from "./tools.js";

const REASONS = { read: "read", edge: "read by an edge", hidden: "hidden", missing: "missing" };
const SAME_DEG = 5;

export function needlesPart(store, live) {
  function card(gauge, index, place) {
    const needle = gauge.needles[place];
    const path = `gauges[${index}].needles[${place}]`;
    const others = gauge.needles.filter((each) => each !== needle).map(({ name }) => [name, name]);
    const rename = (document, name) => renameNeedle(document.gauges[index], place, name);
    return h(
      "div",
      { class: `card ${store.selection.needle === place ? "chosen" : ""}`, "data-path": path, role: "group", "aria-label": `Needle ${needle.name}` },
      h("div", { class: "row" }, h("b", {}, needle.name), h("button", { class: "remove", "aria-label": `Remove needle ${needle.name}`, onclick: () => remove(store, { kind: "gauge", index, needle: place }) }, "×")),
      field("Name", input(store, `${path}.name`, { write: rename })),
      field("Angle here", input(store, `${path}.template.at`, { kind: "optional" })),
      field("Template spans", input(store, `${path}.template.span`, { kind: "optional" })),
      others.length ? field("Covered by", choice(store, `${path}.covered_by`, [["", "no other needle"], ...others], "Covered by")) : null,
      typeof needle.template?.at === "number" && h("button", { class: "small", onclick: () => snap(index, place) }, "Find its axis again"),
      tenfold(gauge, index, place),
      more(needle, index, place, path),
      h("p", { class: "quiet small" }, verdict(index, needle.name)),
    );
  }

  // A second pointer all the way round mostly shows ten times what the one before it shows.
  function tenfold(gauge, index, place) {
    if (!place || !gauge.wraps || gauge.needles[place].scale) return null;
    const turn = gauge.wraps * 10 ** place;
    const make = () => store.change("tenfold", (document) => makeCoarser(document, document.gauges[index], place, turn));
    return h("button", { class: "small", id: `tenfold-${place}`, onclick: make }, `A turn of it is worth ${turn}`);
  }

  function more(needle, index, place, path) {
    const isOpen = Boolean(needle.scale || needle.max_rate || needle.template?.picture);
    return details(
      `needle-${place}`,
      "Rate, own scale, cropped picture",
      isOpen,
      field("Fastest change", input(store, `${path}.max_rate`, { kind: "optional", placeholder: "a second, if known" })),
      field("Template picture", input(store, `${path}.template.picture`, { kind: "optional_text", placeholder: "the panel picture" })),
      ...ownScale(needle, index, place, path),
    );
  }

  function ownScale(needle, index, place, path) {
    const owner = { kind: "gauge", index, needle: place };
    const change = (edit) => store.change("own scale", (document) => edit(document.gauges[index].needles[place]));
    if (!needle.scale) {
      const begin = () => {
        change((own) => { own.scale = []; });
        store.select(owner);
      };
      return [h("button", { class: "small", id: `ownscale-${place}`, onclick: begin }, "A scale of its own")];
    }
    const drop = () => change((own) => { delete own.scale; delete own.wraps; });
    return [
      h("h3", { "data-path": `${path}.scale` }, "Its own tick marks"),
      ...scalePart(store, path, needle.scale, owner),
      field("A turn is worth", input(store, `${path}.wraps`, { kind: "optional", placeholder: "on its own scale" })),
      h("button", { class: "small", onclick: drop }, "The gauge's scale again"),
    ];
  }

  function proposals(index, offers) {
    if (!offers) {
      lookForNeedles(store, index);
      return [h("p", { class: "quiet small" }, "Looking for what moves on this dial …")];
    }
    if (!offers.length) return [h("p", { class: "quiet small" }, "Nothing more was seen to move here; point at the needle, or crop it on the unwrapped gauge.")];
    return offers.map((offer, place) =>
      h(
        "div",
        { class: "card offer row-card" },
        h("div", { class: "row" }, h("span", {}, `A needle at ${rounded(offer.at, 1)}°`), h("button", { class: "main accept", id: `accept-${place}`, onclick: () => addNeedle(store, index, offer) }, "Accept")),
      ),
    );
  }

  async function snap(index, needle) {
    store.select({ kind: "gauge", index, needle });
    const angle = await axisAt(store, store.gauge.needles[needle].template.at);
    store.change("axis", (document) => { document.gauges[index].needles[needle].template.at = angle; });
  }

  function verdict(index, name) {
    const result = live.resultOf(index);
    if (!result) return live.keyOf(index) ? "Reading …" : "It is read as soon as there are an anchor and two marks.";
    if (result.error) return "";
    const seen = result.frames.flatMap((frame) => frame.needles.filter((needle) => needle.name === name));
    const counts = Object.entries(REASONS).map(([status, words]) => [seen.filter((each) => each.status === status).length, words]);
    const lowest = seen.length ? Math.min(...seen.map(({ score }) => score)) : 0;
    const lost = result.frames.length - seen.length;
    const words = counts.filter(([count]) => count).map(([count, what]) => `${count} ${what}`);
    return [...words, lost ? `panel not found in ${lost}` : "", `lowest score ${lowest.toFixed(2)}`].filter(Boolean).join(", ");
  }

  return (gauge, index) => {
    const known = gauge.needles || [];
    const offers = offersOn(store, index);
    const isNew = ({ at }) => !known.some(({ template }) => Math.abs((((template?.at ?? 1e9) - at + 540) % 360) - 180) < SAME_DEG);
    return [
      h("h3", { "data-path": `gauges[${index}].needles` }, "Needles"),
      ...known.map((_, place) => card(gauge, index, place)),
      ...(known.length ? [] : proposals(index, offers)),
      h(
        "div",
        { class: "inputs" },
        h("button", { class: "small", onclick: () => pick(store, "needle") }, "Point at a needle (N)"),
        " ",
        known.length > 0 && h("button", { class: "small", onclick: () => lookForNeedles(store, index) }, "Look for others"),
      ),
      ...(known.length && offers ? proposals(index, offers.filter(isNew)) : []),
    ];
  };
}
