// What follows from a gauge's marks as long as nobody drew it otherwise: the turn that they are on, the sweep, and the
// scales of coarser needles. And what is written of marks: those without a value count for nothing.
import { areNumbers, nearest, rounded } from "./geometry.js";

export const BEGUN_SWEEP = [135, 405]; // of a gauge that was just drawn
const MOST_BEYOND_DEG = 60; // needles go no further beyond marks, until a sweep says so
const LEAST_GAP_DEG = 8; // between both ends of a sweep
const FULL = 360;

const isValued = ([angle, value]) => areNumbers(angle, value);
export const valued = (marks) => (marks || []).filter(isValued);

const changes = (marks) => marks.slice(1).map(([, value], place) => Math.sign(value - marks[place][1]));
const isMonotone = (marks) => new Set(changes(marks)).size < 2 && !changes(marks).includes(0);
const rises = (marks) => changes(marks).every((each) => each > 0);

// The marks on the turn on which their values rise, or else fall, all along the dial; null where they do on none.
function onTheirTurn(marks) {
  const known = valued(marks).map(([angle, value]) => [((angle % FULL) + FULL) % FULL, value]);
  known.sort(([one], [other]) => one - other);
  const turns = known.map((_, first) => known.map((_, place) => {
    const [angle, value] = known[(first + place) % known.length];
    return [first + place < known.length ? angle : angle + FULL, value];
  }));
  return turns.find(rises) || (known.length > 2 && turns.find(isMonotone)) || null;
}

// The sweep that marks, needles and turn tell.
export function toldSweep({ scale, wraps, sweep, needles }) {
  if (wraps) return sweep?.[1] - sweep?.[0] === FULL ? sweep : [0, FULL];
  const known = valued(scale).map(([angle]) => angle);
  if (known.length < 2) return BEGUN_SWEEP;
  const [first, last] = [Math.min(...known), Math.max(...known)];
  const beyond = Math.max(Math.min(MOST_BEYOND_DEG, (FULL - LEAST_GAP_DEG - (last - first)) / 2), 0);
  let ends = [first - beyond, last + beyond];
  for (const { template } of needles || []) {
    if (!areNumbers(template?.at)) continue;
    const at = nearest(template.at, (first + last) / 2);
    ends = [Math.min(ends[0], at), Math.max(ends[1], at)];
  }
  return ends[1] - ends[0] <= FULL ? ends.map((each) => rounded(each, 1)) : [first, last].map((each) => rounded(each, 1));
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
const times = (marks, factor) => marks.map(([angle, value]) => [angle, typeof value === "number" ? rounded(value * factor, 8) : value]);

// A needle's scale is as many times the gauge's as a turn of it is worth more.
export const coarser = ({ scale, wraps }, turn) => times(scale, turn / wraps);

export function followMarks(before, after) {
  if (before.gauges?.length !== after.gauges?.length) return;
  after.gauges.forEach((gauge, index) => {
    const was = before.gauges[index];
    const told = ({ scale, wraps, needles }) => [scale, wraps, (needles || []).map(({ template }) => template?.at)];
    if (gauge.window || !gauge.scale || same(told(was), told(gauge))) return;
    const wasTold = same(was.sweep, BEGUN_SWEEP) || same(was.sweep, toldSweep(was));
    if (!same(was.scale, gauge.scale)) {
      const known = valued(gauge.scale);
      if (known.length > 1 && (!isMonotone(known) || (wasTold && !gauge.wraps && !rises(known)))) turn(gauge);
    }
    if ((wasTold || gauge.wraps) && same(was.sweep, gauge.sweep)) gauge.sweep = [...toldSweep(gauge)];
    else if (wasTold && !same(was.scale, gauge.scale)) gauge.sweep = [...toldSweep(gauge)];
    for (const [place, needle] of (gauge.needles || []).entries()) {
      const own = was.needles?.[place];
      if (own?.scale && own.wraps && was.wraps && gauge.wraps && same(own.scale, coarser(was, own.wraps))) {
        needle.scale = coarser(gauge, needle.wraps);
      }
    }
  });
}

function turn(gauge) {
  const turned = onTheirTurn(gauge.scale);
  if (!turned) return;
  const middle = (turned[0][0] + turned.at(-1)[0]) / 2;
  const open = gauge.scale.filter((mark) => !isValued(mark)).map(([angle, value]) => [areNumbers(angle) ? nearest(angle, middle) : angle, value]);
  gauge.scale = [...turned.map(([angle, value]) => [rounded(angle, 4), value]), ...open].sort(([one], [other]) => one - other);
}

export const isGiven = ([, value]) => value !== null && value !== undefined;

// The draft as it is written: without the marks that nobody gave a value.
export function written(document) {
  const plain = structuredClone(document);
  for (const gauge of plain.gauges || []) {
    for (const own of [gauge, ...(gauge.needles || [])]) if (own.scale) own.scale = own.scale.filter(isGiven);
  }
  return plain;
}

// The path in the draft of what has a path in what is written of it.
export function asDrawn(document, path) {
  const match = /^gauges\[(\d+)\](?:\.needles\[(\d+)\])?\.scale\[(\d+)\]/.exec(path);
  if (!match) return path;
  const gauge = document.gauges?.[match[1]];
  const marks = (match[2] === undefined ? gauge : gauge?.needles?.[match[2]])?.scale;
  if (!Array.isArray(marks)) return path;
  const places = marks.map((mark, place) => [mark, place]).filter(([mark]) => isGiven(mark));
  return path.replace(/\.scale\[\d+\]/, `.scale[${places[match[3]]?.[1] ?? match[3]}]`);
}
