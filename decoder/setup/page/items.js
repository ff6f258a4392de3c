// What can be selected, and how it moves: one table, so that dragging, nudging and removing treat all things alike.
import { marksOf, recentre } from "./dials.js";
import { BEGUN_SWEEP, coarser } from "./following.js";
import { inSweep, nearest, rounded } from "./geometry.js";
import { becomes } from "./kinds.js";

const px = (value) => rounded(value, 2);
const LEAST_RIM = 5;
const SAME_DEG = 1; // two clicks on one mark
const SHORTEST = 0.55; // of the shortest hand lies nearer to the centre than what is read

// Turns what a gauge has at an angle by as many pixels along its rim.
const turned = (gauge, angle, dx, dy) =>
  rounded(angle + ((dx || dy) * 57.29578) / gauge.radius[1], 4);

const KINDS = {
  anchor: {
    list: "anchors",
    move(anchor, dx, dy) {
      anchor.box[0] = Math.round(anchor.box[0] + dx);
      anchor.box[1] = Math.round(anchor.box[1] + dy);
    },
  },
  level: {
    move(level, dx, dy, { end }) {
      for (const point of end === undefined ? level : [level[end]]) {
        point[0] = px(point[0] + dx);
        point[1] = px(point[1] + dy);
      }
    },
  },
  reference: {
    list: "reference_points",
    move(point, dx, dy) {
      point.at = [px(point.at[0] + dx), px(point.at[1] + dy)];
    },
  },
  gauge: {
    list: "gauges",
    move(gauge, dx, dy, selection, plane) {
      const { mark, needle, rim, corner } = selection;
      if (gauge.window) {
        for (const point of corner === undefined ? gauge.window : [gauge.window[corner]]) {
          point[0] = px(point[0] + dx);
          point[1] = px(point[1] + dy);
        }
      } else if (rim !== undefined) gauge.rim[rim] = [px(gauge.rim[rim][0] + dx), px(gauge.rim[rim][1] + dy)];
      else if (mark !== undefined) {
        const own = marksOf(gauge, selection)[mark];
        own[0] = turned(gauge, own[0], dx, dy);
      } else if (needle !== undefined) {
        const { template } = gauge.needles[needle];
        if (typeof template.at === "number") template.at = turned(gauge, template.at, dx, dy);
      } else recentre(gauge, plane, [gauge.centre[0] + dx, gauge.centre[1] + dy]);
    },
  },
};

export function itemOf(document, { kind, index }) {
  return kind === "level" ? document.level : document[KINDS[kind]?.list]?.[index];
}

export const canMove = ({ kind }) => kind in KINDS;

export function move(store, dx, dy) {
  const { selection } = store;
  if (!canMove(selection)) return;
  const plane = selection.kind === "gauge" && store.gauge.centre ? store.planes.of(selection.index) : null;
  store.change(`move ${JSON.stringify(selection)}`, (document) => {
    KINDS[selection.kind].move(itemOf(document, selection), dx, dy, selection, plane);
  });
}

export function remove(store, selection = store.selection) {
  const { kind, index, mark, needle, rim } = selection;
  if (!canMove(selection)) return;
  if (rim !== undefined && store.document.gauges[index].rim.length <= LEAST_RIM) {
    store.tell("say", "A rim needs five points.");
    return;
  }
  const parent = [mark, needle, rim].some((each) => each !== undefined);
  store.change(`remove ${kind}`, (document) => {
    if (kind === "level") delete document.level;
    else if (rim !== undefined) document.gauges[index].rim.splice(rim, 1);
    else if (mark !== undefined) marksOf(document.gauges[index], selection).splice(mark, 1);
    else if (needle !== undefined) removeNeedle(document.gauges[index], needle);
    else document[KINDS[kind].list].splice(index, 1);
    if (kind === "reference" && !document.reference_points.length) delete document.reference_points;
  });
  store.select(parent ? { kind, index } : { kind: "panel" });
}

export const free = (list, stem, from = 1) => {
  const taken = new Set((list || []).map((item) => item.name));
  let number = from;
  if (from === 1 && !/^(anchor|gauge|window)$/.test(stem) && !taken.has(stem)) return stem;
  while (taken.has(`${stem}_${number}`)) number += 1;
  return `${stem}_${number}`;
};

export function addAnchor(store, [x1, y1], [x2, y2]) {
  const [left, top] = [Math.round(Math.min(x1, x2)), Math.round(Math.min(y1, y2))];
  const [width, height] = [Math.round(Math.abs(x2 - x1)), Math.round(Math.abs(y2 - y1))];
  store.change("anchor", (document) => {
    document.anchors ??= [];
    document.anchors.push({ name: free(document.anchors, "anchor"), box: [left, top, width, height] });
  });
  store.select({ kind: "anchor", index: store.document.anchors.length - 1 });
}

export function setLevel(store, one, other) {
  store.change("level", (document) => {
    document.level = [one.map(px), other.map(px)];
  });
  store.select({ kind: "level" });
}

export function addReference(store, point) {
  store.change("reference", (document) => {
    document.reference_points ??= [];
    document.reference_points.push({ at: point.map(px), inches: [null, null] });
  });
  store.select({ kind: "reference", index: store.document.reference_points.length - 1 });
}

// Angles in the order in which they were clicked, clockwise or the other way round, on one turn.
function along(angles) {
  const steps = angles.slice(1).map((angle, place) => (((angle - angles[place]) % 360) + 360) % 360);
  const isClockwise = steps.reduce((sum, step) => sum + step, 0) < 360;
  let last = angles[0];
  return [last, ...steps.map((step) => (last = rounded(last + (isClockwise ? step : step - 360), 4)))];
}

// A gauge with the marks that were clicked for its rim: they count as soon as they have a value.
export function addGauge(store, rim, angles) {
  store.planes.keep(rim, rim.matrix);
  [store.firstMark] = angles;
  const marks = along(angles).map((angle) => [angle, null]).sort(([one], [other]) => one - other);
  store.change("gauge", (document) => {
    document.gauges ??= [];
    document.gauges.push({
      name: free(document.gauges, "gauge"),
      centre: rim.centre,
      ...(rim.rim && { rim: rim.rim }),
      radius: [rounded(rim.radius * 0.4, 1), rounded(rim.radius, 1)],
      sweep: [...BEGUN_SWEEP],
      unit: "",
      scale: marks,
      needles: [],
    });
  });
  store.select({ kind: "gauge", index: store.document.gauges.length - 1 });
}

// A window is of the first kind that is read in one, until another is chosen.
export function addWindow(store, corners) {
  const { key } = store.session.kinds.find((kind) => kind.in_window);
  store.change("window", (document) => {
    document.gauges ??= [];
    const gauge = { name: free(document.gauges, "window"), window: corners.map((point) => point.map(px)), unit: "" };
    becomes(store, gauge, key, columnName(document, gauge));
    document.gauges.push(gauge);
  });
  store.select({ kind: "gauge", index: store.document.gauges.length - 1 });
}

// A sweep grown to hold an angle.
const holding = ([first, last], angle) =>
  last - first < 360 ? [Math.min(first, angle), Math.max(last, angle)].map((each) => rounded(each, 2)) : [first, last];

// A sweep that would be more than a turn was not drawn for these marks: it becomes as wide as they are.
const holdingMark = (sweep, marks, angle) => {
  const [first, last] = holding(sweep, angle);
  return last - first <= 360 ? [first, last] : [marks[0][0], marks.at(-1)[0]].map((each) => rounded(each, 2));
};

// The turn that a new mark's angle is on. Marks beyond the sweep that a gauge begins with show that nobody drew that
// one: then people go along the scale, and the mark lies next to the one before.
function onItsTurn(angle, { sweep }, marks, before) {
  const [first, last] = BEGUN_SWEEP;
  const isBegun = sweep[0] === first || sweep[1] === last;
  const isBeyond = marks.some(([each]) => each < first || each > last);
  return isBegun && isBeyond && marks[before] ? nearest(angle, marks[before][0]) : inSweep(angle, sweep);
}

// A mark at an angle, in its order along the dial; the sweep grows to hold it. Returns the path of its value.
export function addMark(store, index, angle) {
  let place = 0;
  const { needle, mark: before } = store.selection;
  const own = store.gauge.needles?.[needle]?.scale ? { needle } : {};
  store.change("mark", (document) => {
    const gauge = document.gauges[index];
    const marks = marksOf(gauge, own);
    const first = onItsTurn(angle, gauge, marks, before);
    const again = marks.findIndex(([each, value]) => value === null && Math.abs(nearest(each, first) - first) < SAME_DEG);
    if (again >= 0) marks.splice(again, 1); // one that was clicked for the rim
    marks.push([rounded(first, 4), null]);
    marks.sort((one, other) => one[0] - other[0]);
    place = marks.findIndex(([each]) => each === rounded(first, 4));
    gauge.sweep = holdingMark(gauge.sweep, marks, first);
    store.placedMark = rounded(first, 4);
  });
  store.select({ kind: "gauge", index, mark: place, ...own });
  return `gauges[${index}]${own.needle === undefined ? "" : `.needles[${own.needle}]`}.scale[${place}][1]`;
}

// A name that no column has yet.
export function freeColumn(document, stem) {
  const taken = new Set((document.gauges || []).flatMap((each) => Object.values(each).flat()).map((part) => part?.name).filter(Boolean));
  let name = stem;
  for (let number = 2; taken.has(name); number += 1) name = `${stem}_${number}`;
  return name;
}

export function columnName(document, gauge) {
  const stem = (gauge.name.replace(/\W+/g, "_").replace(/^[^A-Za-z]+/, "") || "needle") + unitSuffix(gauge.unit);
  return freeColumn(document, stem);
}

// A needle; if it is known, by its name and what a turn of it is worth, and what it shows together with finer ones.
export function addNeedle(store, index, { at: angle, span, reach }, { name, turn, together } = {}) {
  store.change("needle", (document) => {
    const gauge = document.gauges[index];
    gauge.needles ??= [];
    const there = inSweep(angle, gauge.sweep);
    gauge.needles.push({ name: name ? freeColumn(document, name) : columnName(document, gauge), template: { at: rounded(there, 4), span } });
    gauge.sweep = holding(gauge.sweep, there);
    if (reach) gauge.radius[0] = Math.min(gauge.radius[0], rounded(reach * SHORTEST, 1)); // the shortest hand is in sight
    if (turn && turn !== gauge.wraps) makeCoarser(document, gauge, gauge.needles.length - 1, turn, together);
  });
  store.select({ kind: "gauge", index, needle: store.document.gauges[index].needles.length - 1 });
}

// A needle whose turn is worth more than the gauge's: its scale follows, and all of them show one value together.
export function makeCoarser(document, gauge, place, turn, together) {
  const own = gauge.needles[place];
  Object.assign(own, { scale: coarser(gauge, turn), wraps: turn, covered_by: gauge.needles[0].name });
  const names = gauge.needles.filter(({ wraps }, each) => !each || wraps).map(({ name }) => name);
  gauge.combined = { name: gauge.combined?.name || (together ? freeColumn(document, together) : columnName(document, gauge)), ...gauge.combined, needles: names };
}

// What names a needle goes along with its name.
export function renameNeedle(gauge, place, name) {
  const before = gauge.needles[place].name;
  gauge.needles[place].name = name;
  for (const needle of gauge.needles) if (needle.covered_by === before) needle.covered_by = name;
  if (gauge.combined?.needles) gauge.combined.needles = gauge.combined.needles.map((each) => (each === before ? name : each));
}

function removeNeedle(gauge, place) {
  const [{ name }] = gauge.needles.splice(place, 1);
  for (const needle of gauge.needles) if (needle.covered_by === name) delete needle.covered_by;
  if (gauge.combined?.needles) gauge.combined.needles = gauge.combined.needles.filter((each) => each !== name);
}

const UNITS = { "%": "pct", "°C": "c", "deg C": "c", "°F": "f", "deg F": "f", "°": "deg" };

function unitSuffix(unit) {
  const word = (UNITS[unit] ?? unit ?? "").replace(/\W+/g, "_").replace(/^_+|_+$/g, "").toLowerCase();
  return word ? `_${word}` : "";
}
