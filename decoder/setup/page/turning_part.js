// What turns on a gauge: needles, or a card under an index; and the one value that several pointers show together.
import { h } from "./dom.js";
import { field, input } from "./fields.js";
import { columnName } from "./items.js";

const UP_DEG = 270;

export function turningPart(store, gauge, index) {
  const path = `gauges[${index}]`;
  return [...kind(store, gauge, index), ...(gauge.card ? card(store, path) : []), ...(gauge.card ? [] : combined(store, gauge, index, path))];
}

function kind(store, gauge, index) {
  const turn = (event) =>
    store.change("what turns", (document) => {
      const own = document.gauges[index];
      if (event.target.value === "card") {
        delete own.needles;
        delete own.combined;
        delete own.tail;
        own.card = { name: columnName(document, own), index: UP_DEG };
      } else {
        delete own.card;
        own.needles = [];
      }
    });
  const options = [["needles", "needles"], ["card", "a card under an index"]];
  const select = h(
    "select",
    { id: `what-turns-${index}`, onchange: turn },
    ...options.map(([value, words]) => h("option", { value, selected: (value === "card") === Boolean(gauge.card) }, words)),
  );
  return [h("h3", {}, "What turns"), field("On this dial", select)];
}

function card(store, path) {
  return [
    h("div", { "data-path": `${path}.card` }),
    field("Name", input(store, `${path}.card.name`)),
    field("Index at", input(store, `${path}.card.index`, { kind: "number", placeholder: "degrees; 270 is up" })),
    field("Fastest change", input(store, `${path}.card.max_rate`, { kind: "optional", placeholder: "a second, if known" })),
    h("p", { class: "quiet small" }, "Click its marks wherever the card is turned in this picture, and say what a turn is worth."),
  ];
}

function combined(store, gauge, index, path) {
  const names = (gauge.needles || []).map(({ name }) => name);
  if (!gauge.combined) {
    if (names.length < 2) return [];
    const begin = () =>
      store.change("combine", (document) => {
        const own = document.gauges[index];
        own.combined = { name: columnName(document, own), needles: names };
      });
    return [h("button", { class: "small", id: "combine", onclick: begin }, "One value of all its needles")];
  }
  const boxes = names.map((name) => {
    const box = h("input", { type: "checkbox", id: `part-${index}-${name}`, onchange: () => store.change("combine", (document) => {
      const own = document.gauges[index].combined;
      own.needles = names.filter((each) => (each === name ? box.checked : own.needles.includes(each)));
    }) });
    box.checked = gauge.combined.needles?.includes(name);
    return h("label", { class: "inputs", for: box.id }, box, name);
  });
  const part = `${path}.combined`;
  const drop = () => store.change("uncombine", (document) => { delete document.gauges[index].combined; });
  return [
    h(
      "div",
      { class: "card", "data-path": part, role: "group", "aria-label": "One value of several needles" },
      h("div", { class: "row" }, h("b", {}, "One value of several needles"), h("button", { class: "remove", "aria-label": "Remove the combined value", onclick: drop }, "×")),
      field("Name", input(store, `${part}.name`)),
      h("fieldset", { "data-path": `${part}.needles` }, h("legend", { class: "quiet small" }, "Its needles"), ...boxes),
      field("Tolerance", input(store, `${part}.tolerance`, { kind: "optional", placeholder: "0.2 of a finer turn" })),
      field("Values begin at", input(store, `${part}.lowest`, { kind: "optional", placeholder: "0" })),
      field("Fastest change", input(store, `${part}.max_rate`, { kind: "optional", placeholder: "a second, if known" })),
    ),
  ];
}
