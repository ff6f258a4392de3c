// Who gets how much of the screen: the outline, the details and the strips of the flight fold, and the picture takes
// their place. Where there is little room they begin folded, and the outline lies over the picture.
import { byId, h } from "./dom.js";
import { keep, kept } from "./kept.js";

const NARROW = matchMedia("(max-width: 900px), (max-height: 560px)");
const MEDIUM = matchMedia("(max-width: 1199px)");

const PARTS = {
  outline: { key: "1", part: "outline", begins: () => !NARROW.matches },
  details: { key: "2", part: "inspector", begins: () => true },
  unwrapped: { key: "3", part: "unwrapped", words: "Unwrapped", begins: () => !MEDIUM.matches },
  film: { key: "4", part: "film", words: "Filmstrip", begins: () => !NARROW.matches },
};

export const FOLDING = Object.fromEntries(Object.entries(PARTS).map(([name, { key }]) => [key, name]));

export class Room {
  constructor(store) {
    const folds = ["unwrapped", "film"].map((name) =>
      h("button", { id: `fold-${name}`, class: "small", title: `${PARTS[name].words} (${PARTS[name].key})`, "aria-keyshortcuts": PARTS[name].key, "aria-controls": name }, PARTS[name].words),
    );
    byId("frames").append(h("div", { class: "folds" }, ...folds));
    for (const name of Object.keys(PARTS)) byId(`fold-${name}`).addEventListener("click", () => this.fold(name));
    for (const query of [NARROW, MEDIUM]) query.addEventListener("change", () => this.show());
    store.on("type", () => this.unfold("details")); // where somebody is to type must be seen
    store.on("list", () => this.unfold("outline"));
    store.on("select", () => {
      if (byId("found").contains(document.activeElement)) return; // one after the other is accepted there
      if (this.covered.delete("outline")) this.show();
    });
    this.covered = new Set(); // what was opened over the picture, until something is chosen there
    this.show();
  }

  // What was chosen for a wide screen is not what was chosen for a narrow one.
  name(part) {
    return `${part}${NARROW.matches ? "-narrow" : MEDIUM.matches ? "-medium" : ""}`;
  }

  isOpen(part) {
    if (part === "outline" && NARROW.matches) return this.covered.has(part);
    return kept(this.name(part)) ?? PARTS[part].begins();
  }

  fold(part, opens = !this.isOpen(part)) {
    if (part === "outline" && NARROW.matches) this.covered[opens ? "add" : "delete"](part);
    else keep(this.name(part), opens);
    const isLeft = !opens && byId(PARTS[part].part).contains(document.activeElement);
    this.show();
    if (isLeft) byId("picture").focus({ preventScroll: true });
  }

  unfold(part) {
    if (!this.isOpen(part)) this.fold(part, true);
  }

  show() {
    for (const part of Object.keys(PARTS)) {
      const isOpen = this.isOpen(part);
      document.body.classList.toggle(`no-${part}`, !isOpen);
      byId(`fold-${part}`).setAttribute("aria-pressed", isOpen);
    }
  }
}
