// What is drawn, what is selected, and the way back: one document, changed only through `change`.
import { followMarks } from "./following.js";

const TOGETHER_MS = 700;

export class Store extends EventTarget {
  constructor(session) {
    super();
    this.session = session;
    this.now = { document: session.document, picture: session.picture, size: session.size };
    this.revision = session.revision;
    this.saved = JSON.stringify(this.now);
    this.past = [];
    this.future = [];
    this.selection = { kind: "panel" };
    this.tool = "select";
    this.clicks = [];
    this.bends = [];
    this.cursor = [session.size[0] / 2, session.size[1] / 2];
    this.held = null; // where the pointer is that drags something
    this.looking = null; // the key of another frame that is looked at
    this.problems = [];
    this.judged = null; // what they are the problems of
    this.offers = new Map(); // proposed needles by gauge
    this.firstMark = null; // the angle of the mark that was clicked first of all
    this.placedMark = null; // and of the one that was clicked last with its tool
    this.label = null;
    this.hint = ""; // what is said while no tool is used
  }

  get document() {
    return this.now.document;
  }

  get gauge() {
    return this.selection.kind === "gauge" ? this.document.gauges?.[this.selection.index] : undefined;
  }

  get isSaved() {
    return this.saved === JSON.stringify(this.now);
  }

  // Changes with the same label that follow each other closely are one step back.
  change(label, edit, { picture, size } = {}) {
    const together = label === this.label && performance.now() - this.changed < TOGETHER_MS;
    if (!together) this.past.push(structuredClone(this.now));
    this.label = label;
    this.changed = performance.now();
    this.future = [];
    const next = structuredClone(this.now);
    const replaced = edit(next.document);
    if (replaced && typeof replaced === "object") next.document = replaced;
    followMarks(this.now.document, next.document);
    if (picture) Object.assign(next, { picture, size });
    this.now = next;
    this.tell("change");
  }

  undo() {
    this.travel(this.past, this.future);
  }

  redo() {
    this.travel(this.future, this.past);
  }

  travel(from, to) {
    if (!from.length) return;
    to.push(this.now);
    this.now = from.pop();
    this.label = null;
    this.clicks = [];
    if (!this.exists(this.selection)) this.selection = { kind: "panel" };
    this.tell("change");
  }

  replace(session) {
    this.past.push(structuredClone(this.now));
    this.future = [];
    this.now = { document: session.document, picture: session.picture, size: session.size };
    this.revision = session.revision;
    this.saved = JSON.stringify(this.now);
    this.selection = { kind: "panel" };
    this.clicks = [];
    this.tell("change");
  }

  exists({ kind, index, mark, needle, rim }) {
    if (kind === "panel") return true;
    if (kind === "level") return Boolean(this.document.level);
    const list = { anchor: "anchors", reference: "reference_points", gauge: "gauges" }[kind];
    const item = this.document[list]?.[index];
    if (!item) return false;
    const within = (place, parts) => place === undefined || place < (parts || []).length;
    return within(needle, item.needles) && within(rim, item.rim) && within(mark, item.needles?.[needle]?.scale || item.scale);
  }

  select(selection) {
    this.selection = selection;
    this.tell("select");
  }

  // What is wrong with a drawing, once it is known; of one that was changed meanwhile nobody wants to know.
  judge(now, problems) {
    if (now !== JSON.stringify([this.document, this.now.picture])) return false;
    this.problems = problems;
    this.judged = now;
    this.tell("problems");
    return true;
  }

  use(tool) {
    this.tool = tool;
    this.clicks = [];
    this.bends = []; // clicks that bend the rim
    this.tell("tool");
  }

  tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  on(types, listener) {
    types.split(" ").forEach((type) => this.addEventListener(type, listener));
  }
}
