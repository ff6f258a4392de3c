// Instruments that most panels have: one press fills in what they have in common, and their needles are taken as soon as
// they were seen to move and marks tell where they may point.
import { h } from "./dom.js";
import { valued } from "./following.js";
import { inSweep, rounded } from "./geometry.js";
import { addNeedle, free, freeColumn } from "./items.js";
import { becomes, isDrawn, kindOf } from "./kinds.js";
import { lookForNeedles, needleQuestion, offersOn } from "./offers.js";
import { ask, TAB } from "./server.js";

const wanted = new Map(); // what is to be taken on gauges, by their names

export function usualPart(store, gauge, index) {
  if (gauge.unit || isDrawn(store, gauge)) return [];
  const isInWindow = Boolean(gauge.window);
  const all = store.session.kinds.filter((kind) => kind.in_window === isInWindow).flatMap((kind) => kind.usual.map((usual) => [kind, usual]));
  if (!all.length) return [];
  const buttons = all.map(([kind, usual]) => h("button", { class: "usual", "data-usual": usual.name, onclick: () => take(store, index, kind, usual) }, usual.name));
  return [h("div", { class: "chips", role: "group", "aria-label": "Is it one of these?" }, ...buttons)];
}

// The path of the mark that was clicked first, and is still without a value.
export function firstOpen(store, index) {
  const { scale } = store.document.gauges[index];
  const open = scale.map(([angle, value], place) => ({ angle, value, place })).filter(({ value }) => value === null);
  const first = open.find(({ angle }) => Math.abs((angle - store.firstMark) % 360) < 1e-3) || open[0];
  return first && `gauges[${index}].scale[${first.place}][1]`;
}

function take(store, index, kind, usual) {
  store.change("usual", (document) => {
    const gauge = document.gauges[index];
    gauge.name = free(document.gauges.filter((each) => each !== gauge), usual.name);
    gauge.unit = usual.unit;
    if (kindOf(store, gauge) !== kind) becomes(store, gauge, kind.key, freeColumn(document, usual.columns[0]));
    if (usual.turn) Object.assign(gauge, { wraps: usual.turn, sweep: [0, 360] });
    if (usual.both_ends) gauge.scale = atOneEnd(gauge.scale, store.firstMark);
  });
  const next = firstOpen(store, index);
  if (next) store.tell("type", next);
  if (kind.turning) findTurning(store, index, kind);
  if (kind.begun) return;
  wanted.set(store.document.gauges[index].name, usual);
  lookForNeedles(store, index);
}

const SAME_DEG = 1; // two marks, one at each end, that show the same

// Marks of a needle whose both ends point to marks, as one end points to them: that of the mark that was clicked first.
function atOneEnd(marks, clicked) {
  if (!marks?.length) return marks || [];
  const first = marks.some(([angle]) => angle === clicked) ? clicked : marks[0][0];
  const folded = marks.map(([angle, value]) => [rounded(angle - 180 * Math.round((angle - first) / 180), 4), value]);
  const kept = folded.filter(([angle], place) => !folded.slice(0, place).some(([other]) => Math.abs(angle - other) < SAME_DEG));
  return kept.sort(([one], [other]) => one - other);
}

const WITHIN = 0.97; // a window ends a little before the ring around it, which begins a little after its edge
const HUB = 0.04;

// Draws how far what turns reaches, as the flight shows it.
async function findTurning(store, index, kind) {
  const before = store.document.gauges[index];
  const found = await ask("turning", { ...needleQuestion(store, index), sweep: [0, 360], tab: `${TAB}-${index}` }).catch(() => null);
  const gauge = store.document.gauges[index];
  if (!found?.turns || !gauge?.[kind.key] || gauge.radius.join() !== before.radius.join()) return;
  const [first, last] = found.turns;
  store.change("turning", (document) => {
    const own = document.gauges[index];
    if (kind.turning === "radius") own.radius = [first, last];
    else {
      own.radius = [rounded(last * HUB, 1), last];
      Object.assign(own[kind.key], { ring: first, window: rounded(first * WITHIN, 1) });
    }
  });
}

// Takes the needles that are wanted, once it is known where they are and where they may point.
export function followWanted(store) {
  store.on("change trial", () => {
    for (const [index, gauge] of (store.document.gauges || []).entries()) {
      const usual = wanted.get(gauge.name);
      const offers = usual && offersOn(store, index);
      if (usual && offers === undefined) lookForNeedles(store, index);
      if (!offers || valued(gauge.scale).length < 2) continue;
      const there = gauge.needles?.length ? [] : offers.filter((offer) => within(offer, gauge.sweep));
      if (!there.length && !gauge.needles?.length) continue; // marks to come may tell that needles go there
      wanted.delete(gauge.name);
      if (there.length) queueMicrotask(() => takeNeedles(store, index, usual, there));
    }
  });
}

const within = ({ at }, [first, last]) => inSweep(at, [first, last]) >= first && inSweep(at, [first, last]) <= last;

function takeNeedles(store, index, usual, offers) {
  const { selection } = store;
  const longest = offers.slice(0, usual.columns.length).sort((one, other) => other.reach - one.reach); // the finest first
  longest.forEach((offer, place) => addNeedle(store, index, offer, { name: usual.columns[place], turn: usual.turn && usual.turn * 10 ** place, together: usual.together }));
  store.select(selection);
}
