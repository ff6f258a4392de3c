// Proposals over the panel picture: dashed, so that none is taken for what is drawn. A click on one accepts it; while
// somebody points at one, a card beside it says what speaks for it.
import { byId, h, s } from "./dom.js";
import { labelOf } from "./search.js";

const STILL_PX = 4;
const LETTERS_PX = 9;
const LEAST_RING_PX = 34; // around a smaller ring on the screen letters would lie on each other
const NAME_PX = 12;
const LETTER_WIDTH = 0.3; // half of it, as a part of a letter's size
const GAP_PX = 8;
const NUMERAL_PART = 0.1; // half of a numeral's size, as a part of its ring

export const upper = (words) => words[0].toUpperCase() + words.slice(1);

const sentences = (said, name) => (said?.length ? h("ul", { class: `reasons ${name}` }, ...said.map((each) => h("li", {}, upper(each)))) : null);

// What speaks for a proposal, and what is lacking.
export const evidenceOf = ({ evidence, said }) => sentences(evidence || [said], "");
export const lackingOf = ({ lacking }) => sentences(lacking, "lacking");

export class FoundLayer {
  constructor(store, view, search) {
    Object.assign(this, { store, view, search });
    this.layer = s("g", { id: "proposals" });
    view.layer.before(this.layer);
    this.note = h("div", { id: "foundcard", role: "tooltip", hidden: true });
    byId("picture").after(this.note);
    this.groups = new Map();
    this.current = null;
    const draw = () => this.draw();
    store.on("change found tool looking", draw);
    view.addEventListener("place", draw);
    this.followPointer();
    draw();
  }

  get unit() {
    return 1 / this.view.scale;
  }

  draw() {
    const { search, store } = this;
    const { offers } = search;
    const pick = store.tool === "select" ? "" : "aside";
    this.layer.setAttribute("class", store.looking ? "away" : pick);
    this.groups = new Map(offers.map((offer) => [offer, offer === search.anchors ? this.anchors(offer) : this.dial(offer)]));
    this.layer.replaceChildren(...this.groups.values(), ...(search.looking?.box ? [this.lookedAt(search.looking.box)] : []));
    this.point(offers.includes(this.current) && !store.looking ? this.current : null);
  }

  lookedAt([x, y, width, height]) {
    return s("rect", { class: "looked", x, y, width, height, rx: 6 * this.unit });
  }

  words(text, [x, y], { size = 11, anchor = "middle", name = "" } = {}) {
    const label = s("text", { x, y, class: name, "font-size": size * this.unit, "stroke-width": 3 * this.unit, "text-anchor": anchor });
    label.textContent = text;
    return label;
  }

  anchors(offer) {
    const boxes = offer.anchors.map(({ box: [x, y, width, height] }) => {
      const rect = { x: x - 0.5, y: y - 0.5, width, height };
      return [s("rect", { ...rect, class: "halo" }), s("rect", { ...rect, class: "ring" }), s("rect", { ...rect, class: "hit", "data-accept": true })];
    });
    return this.followed(s("g", { class: "proposal" }, ...boxes.flat()), offer);
  }

  dial(offer) {
    const { gauge, plane, centre, rim, marks } = offer;
    const printed = plane.movedTo(centre);
    const radius = rim.reduce((sum, point) => sum + printed.polar(point)[1] / rim.length, 0);
    const ring = { d: printed.arc(radius, 0, 360) };
    const isSmall = radius < LEAST_RING_PX * this.unit;
    const beyond = Math.max(radius + (isSmall ? 4 : 13) * this.unit, ...marks.map(({ numeral }) => printed.polar(numeral)[1] + NUMERAL_PART * radius + 5 * this.unit));
    const [x, y] = printed.at(90, beyond + (marks.length ? 20 : 8) * this.unit);
    const name = offer.read ? `${offer.name} ${offer.read[0]}/${offer.read[1]}` : offer.name;
    return this.followed(
      s(
        "g",
        { class: `proposal ${offer.is_whole ? "" : "part"} ${isSmall ? "small" : ""}` },
        s("path", { ...ring, class: "halo" }),
        s("path", { ...ring, class: "ring" }),
        s("path", { ...ring, class: "hit", "data-accept": true }),
        ...(gauge.needles || []).map(({ template }) => this.axis(plane, gauge.radius, template?.at)),
        ...marks.map((mark) => this.mark(offer, printed, mark, beyond)),
        this.words(name, [x, y], { size: NAME_PX, name: "name" }),
        this.cross([x + (name.length * NAME_PX * LETTER_WIDTH + 14) * this.unit, y - (NAME_PX / 3) * this.unit], offer.name),
      ),
      offer,
    );
  }

  axis(plane, radius, angle) {
    if (typeof angle !== "number") return "";
    const [[x1, y1], [x2, y2]] = radius.map((each) => plane.at(angle, each));
    return s("g", {}, s("line", { x1, y1, x2, y2, class: "halo" }), s("line", { x1, y1, x2, y2, class: "axis" }));
  }

  // A mark, and beside it, beyond its numeral, what was read.
  mark(offer, printed, mark, beyond) {
    const [cx, cy] = mark.mark;
    const [angle] = printed.polar(mark.mark);
    const [x, y] = printed.at(angle, beyond);
    const side = Math.cos((angle * Math.PI) / 180);
    const anchor = side > 0.4 ? "start" : side < -0.4 ? "end" : "middle";
    const label = this.words(labelOf(offer, mark), [x, y + (LETTERS_PX / 3) * this.unit], { size: LETTERS_PX, anchor });
    return s("g", { class: "mark" }, s("circle", { cx, cy, r: 2.6 * this.unit, class: "dot" }), label);
  }

  cross([x, y], name) {
    const r = 8 * this.unit;
    const d = r * 0.4;
    return s(
      "g",
      { class: "dismiss", "data-dismiss": true },
      s("title", {}, `Dismiss ${name}`),
      s("circle", { cx: x, cy: y, r }),
      s("path", { d: `M${x - d} ${y - d}l${2 * d} ${2 * d}M${x + d} ${y - d}l${-2 * d} ${2 * d}` }),
    );
  }

  followed(group, offer) {
    group.offer = offer;
    group.addEventListener("pointerenter", () => this.point(offer));
    group.addEventListener("pointerleave", () => this.point(null));
    return group;
  }

  // Tells which proposal is meant, here and in the list.
  point(offer) {
    if (this.current !== offer) {
      this.current = offer;
      this.store.tell("meant", offer);
    }
    for (const [each, group] of this.groups) group.classList.toggle("current", each === offer);
    this.note.hidden = !offer;
    if (!offer) return;
    this.note.replaceChildren(h("b", {}, offer.name || `${offer.anchors.length} anchors`), evidenceOf(offer), ...[lackingOf(offer)].filter(Boolean), h("p", { class: "quiet" }, "Click to accept."));
    this.placeNote(this.groups.get(offer));
  }

  // Beside what it is about, within the picture.
  placeNote(group) {
    const { note } = this;
    const room = this.view.svg.getBoundingClientRect();
    const own = group.getBoundingClientRect();
    const main = note.offsetParent.getBoundingClientRect();
    const right = own.right + GAP_PX;
    const left = right + note.offsetWidth < room.right ? right : Math.max(own.left - note.offsetWidth - GAP_PX, room.left + GAP_PX);
    const middle = (own.top + own.bottom - note.offsetHeight) / 2;
    note.style.left = `${left - main.left}px`;
    note.style.top = `${Math.max(Math.min(middle, room.bottom - note.offsetHeight - GAP_PX), room.top + GAP_PX) - main.top}px`;
  }

  // A press that moves is a drag of the picture; only one that stays accepts.
  followPointer() {
    const { svg } = this.view;
    let press = null;
    svg.addEventListener("pointerdown", (event) => {
      const group = event.target.closest?.(".proposal");
      const isOther = event.button !== 0 || this.store.tool !== "select";
      press = group && !isOther ? { offer: group.offer, dismisses: Boolean(event.target.closest("[data-dismiss]")), x: event.clientX, y: event.clientY } : null;
    });
    svg.addEventListener("pointerup", (event) => {
      const { offer, dismisses, x, y } = press || {};
      press = null;
      if (!offer || Math.hypot(event.clientX - x, event.clientY - y) >= STILL_PX) return;
      if (dismisses) this.search.dismiss(offer);
      else this.search.accept(offer);
    });
  }
}
