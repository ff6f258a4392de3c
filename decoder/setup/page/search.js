// The search for dials: what is proposed on the panel picture, and what becomes of it. Whatever is drawn already, or was
// dismissed, is not offered; so an accepted proposal is offered again as soon as it is undone.
import { areNumbers, distance, nearest } from "./geometry.js";
import { free, freeColumn, renameNeedle } from "./items.js";
import { written } from "./following.js";
import { Plane } from "./planes.js";
import { askAlong, Lost, TAB } from "./server.js";

const LEAST_POINTS = 3; // fewer tell nothing of how dials are seen, nor does the level edge without them
const SAME_DEG = 1; // a mark where it was measured, and where it stands in a scale

export class Search {
  constructor(store) {
    this.store = store;
    this.forget();
    store.on("change", () => {
      if (this.key !== undefined && this.key !== this.keyNow) this.discard();
    });
  }

  // What proposals depend on: the picture, and how its dials are seen.
  get keyNow() {
    const { reference_points: points, level, ...seen } = this.store.planes.seen;
    const whole = (points || []).filter(({ at, inches }) => areNumbers(at, inches));
    return JSON.stringify(whole.length < LEAST_POINTS ? seen : { ...seen, whole, level });
  }

  get isRunning() {
    return Boolean(this.abort);
  }

  forget() {
    this.key = undefined;
    this.proposals = [];
    this.anchors = null;
    this.notes = [];
    this.looking = null; // what is looked at, in words and as a box
    this.dismissed = [];
    this.abort = null;
    this.hasAccepted = false;
    this.broken = ""; // why a search did not come to its end
  }

  discard() {
    const had = this.isRunning || this.offers.length;
    this.abort?.abort();
    this.forget();
    if (had) this.notes = ["what was found belongs to another picture, or to another view of it: find dials again"];
    this.store.tell("found");
  }

  stop() {
    this.abort?.abort();
    this.abort = null;
    this.looking = null;
    this.broken = "Stopped.";
    this.store.tell("found");
  }

  async start() {
    if (this.isRunning) return;
    const { dismissed } = this;
    this.forget();
    Object.assign(this, { dismissed, key: this.keyNow, abort: new AbortController() });
    this.looking = { said: "beginning", box: null };
    this.store.tell("found");
    const own = this.abort;
    const { document, picture } = this.store.now;
    try {
      for await (const step of askAlong("found", { document: written(document), picture, tab: TAB }, own.signal)) {
        if (this.abort !== own) return;
        this.take(step);
        this.store.tell("found");
      }
    } catch (error) {
      if (this.abort !== own) return;
      this.broken = "Not finished.";
      if (!(error instanceof Lost)) this.store.tell("say", error.message);
    }
    this.abort = null;
    this.looking = null;
    this.store.tell("found");
  }

  take({ looking, box, note, anchors, proposed, withdrawn, error }) {
    if (looking) this.looking = { said: looking, box };
    if (anchors?.length) this.anchors = { anchors, said: note };
    else if (note) this.notes.push(note);
    if (proposed) this.proposals.push({ ...proposed, place: this.proposals.length, plane: new Plane(proposed.matrix) });
    if (withdrawn !== undefined) this.withdraw(this.proposals[withdrawn]);
    if (error) throw new Error(error);
  }

  withdraw(offer) {
    offer.isWithdrawn = true;
    if (!offer.isAccepted || !this.store.document.gauges?.some((other) => same(offer.gauge, other))) return;
    this.notes.push(`the dial that you accepted as ${offer.name} turned out not to be a separate dial: check it, or remove it`);
  }

  // What waits for an answer: anchors first, then gauges in the order in which they were found.
  get offers() {
    const isThere = ({ gauge, isWithdrawn }) => !isWithdrawn && !this.dismissed.some((other) => same(gauge, other)) && !(this.store.document.gauges || []).some((other) => same(gauge, other));
    return [...(this.anchorsOffered ? [this.anchors] : []), ...this.proposals.filter(isThere)];
  }

  get anchorsOffered() {
    return Boolean(this.anchors && !this.dismissed.includes("anchors") && !this.store.document.anchors?.length);
  }

  // Those that were read on the flight.
  get sure() {
    return this.offers.filter((offer) => offer === this.anchors || (offer.is_whole && offer.read));
  }

  accept(offer) {
    this.acceptAll([offer], `accept ${offer.place}`);
  }

  // One step back takes all of it away. Without an anchor nothing is read: the proposed ones go along with a gauge.
  acceptAll(offers = this.sure, label = "accept all") {
    const { store, anchors, anchorsOffered } = this;
    const gauges = offers.filter((offer) => offer !== anchors);
    this.hasAccepted = true;
    const first = store.document.gauges?.length || 0;
    for (const offer of gauges) offer.isAccepted = true;
    for (const { gauge, matrix } of gauges) if (store.planes.isOblique(gauge)) store.planes.keep(gauge, matrix);
    store.change(label, (document) => {
      if (anchorsOffered) document.anchors = structuredClone(anchors.anchors);
      document.gauges ??= [];
      for (const { gauge } of gauges) document.gauges.push(named(document, gauge));
    });
    store.select(gauges.length ? { kind: "gauge", index: first } : { kind: "anchor", index: 0 });
    store.tell("found");
  }

  dismiss(offer) {
    this.dismissed.push(offer === this.anchors ? "anchors" : offer.gauge);
    this.store.tell("found");
  }

  restore() {
    this.dismissed = [];
    this.store.tell("found");
  }
}

// Whether two gauges are one dial: their centres lie nearer than half of the smaller one's radius.
function same(one, other) {
  if (!areNumbers(one.centre, one.radius) || !areNumbers(other.centre, other.radius)) return false;
  if (one.window || other.window || !one.centre || !other.centre) return false;
  return 2 * distance(one.centre, other.centre) < Math.min(one.radius[1], other.radius[1]);
}

// A proposed gauge under names that nothing in the draft has yet.
function named(document, gauge) {
  const own = structuredClone(gauge);
  own.name = free(document.gauges, own.name);
  own.needles?.forEach(({ name }, place) => renameNeedle(own, place, freeColumn(document, name)));
  for (const [key, part] of Object.entries(own)) {
    if (key !== "needles" && typeof part?.name === "string") part.name = freeColumn(document, part.name);
  }
  return own;
}

// What was read beside a mark, and what the mark is worth in the proposed scale if that is something else; in doubt
// where the scale leaves its value open.
export function labelOf({ gauge, plane }, { said, mark }) {
  const read = said.trim().slice(0, 8);
  const angle = plane.angleOf(mark);
  const own = (gauge.scale || []).find(([each]) => Math.abs(nearest(each, angle) - angle) < SAME_DEG);
  if (!own) return read;
  if (own[1] === null) return `${read}?`;
  return Number(read) === own[1] ? read : `${read} → ${own[1]}`;
}
