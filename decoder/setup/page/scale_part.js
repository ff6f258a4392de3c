// The table of a scale's marks: of a gauge, or of a needle that has its own.
import { byId, h } from "./dom.js";
import { input, valueAt } from "./fields.js";
import { isSurelyOnTurn, suggested } from "./geometry.js";
import { remove } from "./items.js";
import { pick } from "./tools.js";

// The next mark clockwise of an angle that has no value yet; null if all have one.
function openAfter(marks, angle) {
  const open = marks.map(([at, value], place) => ({ on: (((at - angle) % 360) + 360) % 360, value, place })).filter(({ value }) => value === null);
  open.sort((one, other) => one.on - other.on);
  return open[0]?.place ?? null;
}

// `owner` is the selection whose marks they are, `path` where its `scale` stands.
export function scalePart(store, path, marks, owner) {
  const { selection } = store;
  const isOwn = selection.needle === owner.needle;
  const turn = valueAt(store.document, `${path}.wraps`);
  const rows = marks.map(([angle, before], mark) => {
    const guess = suggested(marks, mark, turn);
    const place = `${path}.scale[${mark}]`;
    const accept = (text) => {
      if (text.trim() === "" && guess !== undefined) store.change(`type ${place}[1]`, (document) => { valueAt(document, place)[1] = guess; });
      if (before !== null) {
        if (store.tool === "mark") byId("picture").focus();
        else byId(`f:${path}.scale[${mark + 1}][1]`)?.focus();
        return;
      }
      if (typeof turn === "number") fillOthers(mark);
      const next = store.tool === "mark" ? null : openAfter(valueAt(store.document, `${path}.scale`), angle);
      if (next === null) byId("picture").focus({ preventScroll: true });
      else store.tell("type", `${path}.scale[${next}][1]`);
    };
    return h(
      "tr",
      { class: isOwn && selection.mark === mark ? "chosen" : "" },
      h("td", {}, input(store, `${place}[1]`, { kind: "number", label: `value of the mark at ${angle} degrees`, placeholder: guess === undefined ? "value" : `${guess}?`, onenter: accept })),
      h("td", {}, input(store, `${place}[0]`, { kind: "number", label: `angle of mark ${mark + 1}` })),
      h("td", {}, h("button", { class: "remove", "aria-label": `Remove mark ${mark + 1}`, onclick: () => remove(store, { ...owner, mark }) }, "×")),
    );
  });
  // All the way round one value tells all the others that stand where round values are; the rest are asked for.
  function fillOthers(typed) {
    const now = valueAt(store.document, `${path}.scale`);
    const isTold = ([angle, value]) => value === null && isSurelyOnTurn(now[typed], angle, turn);
    const told = now.map((each, mark) => (isTold(each) ? suggested(now, mark, turn) : each[1]));
    if (told.includes(undefined)) return;
    store.change("marks", (document) => valueAt(document, `${path}.scale`).forEach((mark, place) => { mark[1] = told[place]; }));
  }
  const add = () => {
    store.select(owner);
    pick(store, "mark");
  };
  return [
    rows.length ? h("table", {}, h("tr", {}, h("th", {}, "Value"), h("th", {}, "Angle, degrees"), h("th")), ...rows) : h("p", { class: "quiet small" }, "None yet. Two are enough for an even scale."),
    h("button", { class: "small", onclick: add }, "Add tick marks (T)"),
  ];
}
