// The table of a scale's marks: of a gauge, or of a needle that has its own.
import { byId, h } from "./dom.js";
import { input, valueAt } from "./fields.js";
import { suggested } from "./geometry.js";
import { remove } from "./items.js";
import { pick } from "./tools.js";

// `owner` is the selection whose marks they are, `path` where its `scale` stands.
export function scalePart(store, path, marks, owner) {
  const { selection } = store;
  const isOwn = selection.needle === owner.needle;
  const rows = marks.map(([angle], mark) => {
    const guess = suggested(marks, mark);
    const place = `${path}.scale[${mark}]`;
    const accept = (text) => {
      if (text.trim() === "" && guess !== undefined) store.change(`type ${place}[1]`, (document) => { valueAt(document, place)[1] = guess; });
      if (store.tool === "mark") byId("picture").focus();
      else byId(`f:${path}.scale[${mark + 1}][1]`)?.focus();
    };
    return h(
      "tr",
      { class: isOwn && selection.mark === mark ? "chosen" : "" },
      h("td", {}, input(store, `${place}[1]`, { kind: "number", label: `value of the mark at ${angle} degrees`, placeholder: guess === undefined ? "value" : `${guess}?`, onenter: accept })),
      h("td", {}, input(store, `${place}[0]`, { kind: "number", label: `angle of mark ${mark + 1}` })),
      h("td", {}, h("button", { class: "remove", "aria-label": `Remove mark ${mark + 1}`, onclick: () => remove(store, { ...owner, mark }) }, "×")),
    );
  });
  const add = () => {
    store.select(owner);
    pick(store, "mark");
  };
  return [
    rows.length ? h("table", {}, h("tr", {}, h("th", {}, "Value"), h("th", {}, "Angle, degrees"), h("th")), ...rows) : h("p", { class: "quiet small" }, "None yet. Two are enough for an even scale."),
    h("button", { class: "small", onclick: add }, "Add tick marks (T)"),
  ];
}
