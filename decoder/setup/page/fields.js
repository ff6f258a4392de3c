// Fields of the inspector: each writes one value of the draft, and shows beside it what is wrong there.
import { h } from "./dom.js";
import { inPagesWords, wholeSentence } from "./words.js";

const PARTS = /[^.[\]]+/g;

export const partsOf = (path) => path.match(PARTS).map((part) => (/^\d+$/.test(part) ? Number(part) : part));

export function valueAt(document, path) {
  return partsOf(path).reduce((value, part) => value?.[part], document);
}

export function setAt(document, path, value) {
  const parts = partsOf(path);
  const last = parts.pop();
  const parent = parts.reduce((each, part) => (each[part] ??= {}), document);
  if (value === undefined) delete parent[last];
  else parent[last] = value;
}

const shown = (value) => {
  if (Array.isArray(value)) return value.map((each) => (Array.isArray(each) ? each.flat().map(shown).join(" ") : shown(each))).join(", ");
  return typeof value === "number" ? String(Number(value.toFixed(4))) : (value ?? "");
};

const READERS = {
  text: (text) => text,
  // What is no number stays as it was typed: the program says what is wrong with it.
  number: (text) => (text.trim() === "" ? null : Number.isFinite(Number(text.replace(",", "."))) ? Number(text.replace(",", ".")) : text),
  optional: (text) => (text.trim() === "" ? undefined : READERS.number(text)),
  pairs: (text) => text.split(",").filter((part) => part.trim()).map((part) => part.trim().split(/\s+/).map((each) => READERS.number(each))),
  // A place is a number, or x and y, as the list that it is written in tells: 400 or 1109 106.
  place: (text) => {
    const parts = text.trim().split(/\s+/).map((each) => READERS.number(each));
    return parts.length === 1 ? parts[0] : parts;
  },
  points: (text) => READERS.pairs(text),
  places: (text) => READERS.pairs(text).map((part) => (part.length === 3 ? [part.slice(0, 2), part[2]] : part)),
  optional_text: (text) => (text.trim() === "" ? undefined : text),
};

export function input(store, path, { kind = "text", label, placeholder, onenter, width, write, grows } = {}) {
  const own = valueAt(store.document, path);
  const written = kind === "place" ? shown([own]) : shown(own);
  const commit = (event) => {
    if (event.target.value === event.target.dataset.shown) return;
    event.target.dataset.shown = event.target.value;
    const value = READERS[kind](event.target.value);
    if (value === valueAt(store.document, path)) return;
    store.change(`type ${path}`, (document) => (write ? write(document, value) : setAt(document, path, value)));
  };
  // A field that is replaced while somebody types in it loses the focus: that is no end of typing.
  const unlessDrawn = (event) => event.target.closest("#inspector:not([data-drawing])") && commit(event);
  const field = h("input", {
    id: `f:${path}`,
    "data-path": path,
    "aria-label": label,
    value: written,
    "data-shown": written,
    "data-grows": grows, // what is clicked stands at its end, and its value is typed behind it
    placeholder,
    inputmode: kind === "number" || kind === "optional" ? "decimal" : undefined,
    autocomplete: "off",
    spellcheck: "false",
    onchange: unlessDrawn,
    onblur: unlessDrawn,
    onkeydown: (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault();
      commit(event);
      onenter?.(event.target.value);
    },
  });
  if (width) field.style.width = width;
  return field;
}

// One of several words.
export function choice(store, path, options, label) {
  const now = valueAt(store.document, path) ?? "";
  return h(
    "select",
    { id: `f:${path}`, "data-path": path, "aria-label": label, onchange: (event) => store.change(`choose ${path}`, (document) => setAt(document, path, event.target.value || undefined)) },
    ...options.map(([value, name]) => h("option", { value, selected: value === now }, name)),
  );
}

export function check(store, path, label) {
  const box = h("input", { id: `f:${path}`, type: "checkbox", "data-path": path, onchange: (event) => store.change(`check ${path}`, (document) => setAt(document, path, event.target.checked || undefined)) });
  box.checked = Boolean(valueAt(store.document, path));
  return h("div", { class: "field" }, h("span"), h("label", { class: "inputs", for: `f:${path}` }, box, label));
}

export function field(label, ...inputs) {
  const labelled = inputs.length === 1 ? h("label", { for: inputs[0].id }, label) : h("span", { class: "label" }, label);
  return h("div", { class: "field" }, labelled, h("div", { class: "inputs" }, ...inputs));
}

// Two numbers of a list.
export function pair(store, path, label, names, options) {
  return field(label, ...[0, 1].map((end) => input(store, `${path}[${end}]`, { kind: "number", label: names[end], ...options })));
}

// Two numbers that may both be left out.
export function optionalPair(store, path, label, names) {
  const write = (end) => (document, value) => {
    const both = [...(valueAt(document, path) || [null, null])];
    both[end] = value ?? null;
    setAt(document, path, both.every((each) => each === null) ? undefined : both);
  };
  const inputs = [0, 1].map((end) => input(store, `${path}[${end}]`, { kind: "number", label: names[end], placeholder: "if any", write: write(end) }));
  const row = field(label, ...inputs);
  row.dataset.path = path;
  return row;
}

const opened = new Map(); // what somebody opened or shut, by its name

// A part that is shut as long as nobody needs it.
export function details(name, words, isOpen, ...parts) {
  const part = h("details", { open: opened.get(name) ?? isOpen, "data-name": name }, h("summary", {}, words), ...parts);
  part.querySelector("summary").addEventListener("click", () => opened.set(name, !part.open));
  return part;
}

// Puts each problem beside the field it belongs to: the one with the longest path that the problem's path begins with.
export function showProblems(store, root, problems, whole) {
  const fields = [...root.querySelectorAll("[data-path]")];
  for (const { path, problem } of problems) {
    const inside = fields.filter(({ dataset }) => path === dataset.path || path.startsWith(`${dataset.path}.`) || path.startsWith(`${dataset.path}[`));
    inside.sort((one, other) => other.dataset.path.length - one.dataset.path.length);
    const beneath = inside[0] || (path.startsWith(whole) && path !== whole ? fields.find(({ dataset }) => dataset.path.startsWith(path)) : null);
    const own = inside[0] || beneath;
    const id = `problem ${path}`;
    const isBeside = Boolean(inside[0]) || path === whole;
    const words = (isBeside ? inPagesWords : wholeSentence)(store, problem, path);
    const note = h("p", { class: "problem", id, "data-problem": path }, words);
    if (!own) {
      root.querySelector("[data-whole]")?.closest("header").after(note);
      continue;
    }
    if (/INPUT|SELECT/.test(own.tagName)) {
      own.setAttribute("aria-invalid", "true");
      own.setAttribute("aria-describedby", id);
    }
    const place = own.closest(".field") || own.closest("td") || own;
    if (place.tagName === "TH" || place.tagName === "H3") place.after(note);
    else place.append(note);
  }
}
