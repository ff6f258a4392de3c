// The keyboard: everything that the pointer can do.
import { byId, h } from "./dom.js";
import { around } from "./geometry.js";
import { itemOf, move, remove } from "./items.js";
import { click, pick, TOOLS } from "./tools.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const KEYS = [
  ["V A L R G W E T N P", "select, anchor, level, reference, gauge, window, ellipse, tick marks, needle, places"],
  ["D", "find dials: look for them, stop looking, go to the first that was found; there Enter accepts, Delete dismisses"],
  ["Arrows", "move what is selected, or the cross of a tool, by a pixel; with Shift by 10, with Alt by a tenth"],
  ["Enter", "place at the cross; in a tick mark's value: on to the next"],
  ["Delete", "remove what is selected"],
  ["Esc", "put the tool down"],
  ["+  −  0  F", "zoom in, out, whole picture, close up on what is selected"],
  ["B", "brightness and contrast of the picture"],
  ["M", "the loupe at the cursor, on and off"],
  ["1 2 3 4", "fold or unfold the outline, the details, the unwrapped gauge, the filmstrip"],
  ["[  ]", "look at the frame before, the next one"],
  ["Ctrl Z, Ctrl Shift Z", "undo, redo"],
  ["Ctrl S", "save"],
];

const BROWSERS = /^[a-z0-9]$/; // with Alt: its tabs, its address
const ONCE = /^[dbm1-4]$/; // what a key that is held would turn on and off

export function showKeys() {
  const dialog = byId("dialog");
  const close = h("button", { class: "main", onclick: () => dialog.close() }, "Close");
  dialog.replaceChildren(
    h("h2", {}, "Keys"),
    h("dl", {}, ...KEYS.flatMap(([key, what]) => [h("dt", {}, h("kbd", {}, key)), h("dd", {}, what)])),
    h("div", { class: "buttons" }, close),
  );
  dialog.showModal();
  close.focus();
}

export function closeUp(store, view) {
  const { kind } = store.selection;
  const item = itemOf(store.document, store.selection);
  if (kind === "gauge") {
    const place = around(item);
    if (place) view.closeUp(...place);
  } else if (kind === "anchor") view.closeUp([item.box[0] + item.box[2] / 2, item.box[1] + item.box[3] / 2], item.box[2]);
  else if (kind === "reference") view.closeUp(item.at, 60);
  else if (kind === "level") view.closeUp(item[0].map((value, axis) => (value + item[1][axis]) / 2), Math.abs(item[1][1] - item[0][1]) / 2);
}

// `others` are what plain keys do besides.
export function followKeys(store, view, { save, step, ...others }) {
  const picture = byId("picture");
  const plain = {
    ...others,
    "?": showKeys,
    "+": () => view.zoom(1.4),
    "=": () => view.zoom(1.4),
    "-": () => view.zoom(1 / 1.4),
    0: () => view.fit(),
    f: () => closeUp(store, view),
    d: () => store.tell("find"),
    "[": () => step(-1),
    "]": () => step(1),
    Escape: () => store.use("select"),
    Delete: () => remove(store),
    Backspace: () => remove(store),
  };
  for (const [name, { key }] of Object.entries(TOOLS)) plain[key] = () => pick(store, name);

  function arrow(event) {
    const size = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
    const [dx, dy] = ARROWS[event.key].map((value) => value * size);
    if (store.tool === "select") move(store, dx, dy);
    else {
      store.cursor = [store.cursor[0] + dx, store.cursor[1] + dy];
      view.follow(store.cursor);
      store.tell("cursor");
    }
  }

  document.addEventListener("keydown", (event) => {
    const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName);
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey) {
      const does = { s: save, z: () => (event.shiftKey ? store.redo() : store.undo()), y: () => store.redo() }[key];
      if (!does || (typing && key !== "s")) return;
      document.activeElement?.blur?.();
      event.preventDefault();
      does();
      return;
    }
    if (byId("dialog").open) return;
    if (typing) {
      if (event.key === "Escape") picture.focus();
      return;
    }
    if (event.key in ARROWS) {
      event.preventDefault();
      arrow(event);
      return;
    }
    if (event.key === "Enter" && (event.target === picture || event.target === document.body)) {
      event.preventDefault();
      click(store, store.cursor);
      return;
    }
    if ((event.altKey && BROWSERS.test(key)) || (event.repeat && ONCE.test(key))) return;
    if (plain[key]) {
      event.preventDefault();
      plain[key]();
    }
  });
}
