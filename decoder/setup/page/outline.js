// The outline: everything that is drawn, and how well it is read.
import { byId, controlNamed, h, nameOf } from "./dom.js";
import { pick } from "./tools.js";

// Which thing a problem's path belongs to.
export function selectionOf(path) {
  const match = /^(anchors|reference_points|gauges)\[(\d+)\](?:\.needles\[(\d+)\])?(?:\.(scale|rim)\[(\d+)\])?/.exec(path);
  if (!match) return { kind: path.startsWith("level") ? "level" : "panel" };
  const [, list, index, needle, part, place] = match;
  const kind = { anchors: "anchor", reference_points: "reference", gauges: "gauge" }[list];
  const inside = { scale: { mark: Number(place) }, rim: { rim: Number(place) } }[part] || {};
  return { kind, index: Number(index), ...(needle && { needle: Number(needle) }), ...inside };
}

// What the coloured points say, in words.
const HOW = {
  gauge: { good: "read well all through the flight", warn: "read with gaps or doubts", bad: "hardly read" },
  anchor: { good: "found in every frame", warn: "not found in some frames", bad: "hardly found: does it move in flight?" },
};

export function showOutline(store, live, view) {
  const nav = h("div");
  byId("outline").append(nav);

  function row(selection, name, { dot = "", count = "" } = {}) {
    const wrong = store.problems.some(({ path }) => {
      const other = selectionOf(path);
      return other.kind === selection.kind && other.index === selection.index;
    });
    const current = store.selection.kind === selection.kind && store.selection.index === selection.index;
    const title = wrong ? "has something to correct" : ((HOW[selection.kind] ?? HOW.anchor)[dot] ?? "");
    return h(
      "li",
      { class: `of-${selection.kind}` },
      h(
        "button",
        { id: `row ${selection.kind} ${selection.index ?? ""}`, "aria-current": current ? "true" : "false", title, onclick: () => store.select(selection), ondblclick: () => view(selection) },
        h("span", { class: `dot ${wrong ? "bad" : dot}` }),
        h("span", { class: "name" }, name || "(no name)"),
        h("span", { class: "count" }, wrong ? "!" : count),
      ),
    );
  }

  function part(title, tool, rows, empty) {
    return [
      h("div", { class: "part" }, h("h3", {}, title), tool && h("button", { class: "link", "aria-label": `Add: ${title}`, onclick: () => pick(store, tool) }, "+ add")),
      rows.length ? h("ul", {}, ...rows) : h("p", { class: "empty" }, empty),
    ];
  }

  function show() {
    const { anchors = [], level, reference_points: points = [], gauges = [] } = store.document;
    const held = nav.contains(document.activeElement) ? nameOf(document.activeElement) : null;
    nav.replaceChildren(
      ...part("Panel", null, [row({ kind: "panel" }, store.document.name)]),
      ...part("Anchors", "anchor", anchors.map(({ name }, index) => row({ kind: "anchor", index }, name, live.anchorSummary(name))), "at least one"),
      ...part("Level edge", "level", level ? [row({ kind: "level" }, "level", live.anchorSummary("level"))] : [], "tells the roll"),
      ...part("Reference points", "reference", points.map(({ inches }, index) => row({ kind: "reference", index }, `${inches.map((each) => each ?? "?").join(", ")} in`)), "for an oblique view"),
      ...part("Gauges", "gauge", gauges.map(({ name }, index) => row({ kind: "gauge", index }, name, live.summary(index))), "at least one"),
    );
    controlNamed(nav, held)?.focus({ preventScroll: true });
  }

  store.on("change select problems trial", show);
  show();
}
