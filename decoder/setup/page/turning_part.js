// What turns on a gauge, by its kind; and the one value that several pointers show together.
import { byId, h } from "./dom.js";
import { check, choice as oneOf, field, input } from "./fields.js";
import { columnName } from "./items.js";
import { becomes, kindOf } from "./kinds.js";
import { pick } from "./tools.js";

export function turningPart(store, gauge, index) {
  const path = `gauges[${index}]`;
  const kind = kindOf(store, gauge);
  const together = kind.along.includes("combined") ? combined(store, gauge, index, path) : [];
  // What else lies on the dial with a form of its own: the card under needles.
  const others = store.session.kinds.filter((each) => each !== kind && gauge[each.key]);
  const forms = [kind, ...others].flatMap((each) => form(store, each, path));
  return [...choice(store, gauge, index), ...forms, ...together];
}

function choice(store, gauge, index) {
  const turn = (event) =>
    store.change("what turns", (document) => {
      const own = document.gauges[index];
      becomes(store, own, event.target.value, columnName(document, own));
    });
  const now = kindOf(store, gauge);
  const fitting = store.session.kinds.filter((kind) => kind.in_window === Boolean(gauge.window));
  const options = fitting.map((kind) => h("option", { value: kind.key, selected: kind === now }, kind.words));
  const [title, where] = gauge.window ? ["What it shows", "In this window"] : ["What turns", "On this dial"];
  return [h("h3", {}, title), field(where, h("select", { id: `what-turns-${index}`, onchange: turn }, ...options))];
}

const toPicture = () => byId("picture").focus({ preventScroll: true });

function control(store, path, { label, reads, placeholder, options, upright }) {
  if (reads === "check") return check(store, path, label);
  if (options.length) return field(label, oneOf(store, path, options.map((each) => [each, each])));
  const grows = Boolean(upright) || reads === "points" || reads === "places";
  const own = input(store, path, { kind: reads, label, placeholder: placeholder || undefined, grows, onenter: toPicture });
  if (!grows) return field(label, own);
  return field(label, own, h("button", { class: "small", title: "Click them in the picture (P)", onclick: () => pick(store, "place") }, "Click"));
}

// The fields of a kind that has no editor of its own.
function form(store, { key, controls, hint }, path) {
  if (!controls.length) return [];
  return [
    h("div", { "data-path": `${path}.${key}` }),
    ...controls.map((each) => control(store, `${path}.${key}.${each.key}`, each)),
    h("p", { class: "quiet small" }, hint),
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
