// What can be selected, and how it moves: one table, so that dragging, nudging and removing treat all things alike.
import { angleOf, at, inSweep, nearest, recentre, rounded } from "./geometry.js";

const px = (value) => rounded(value, 2);

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
    move(gauge, dx, dy, { mark, needle }) {
      if (mark !== undefined) gauge.scale[mark][0] = turned(gauge, gauge.scale[mark][0], dx, dy);
      else if (needle !== undefined) {
        const { template } = gauge.needles[needle];
        if (typeof template.at === "number") template.at = turned(gauge, template.at, dx, dy);
      } else recentre(gauge, [gauge.centre[0] + dx, gauge.centre[1] + dy]);
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
  store.change(`move ${JSON.stringify(selection)}`, (document) => {
    KINDS[selection.kind].move(itemOf(document, selection), dx, dy, selection);
  });
}

export function remove(store, selection = store.selection) {
  const { kind, index, mark, needle } = selection;
  if (!canMove(selection)) return;
  const parent = mark !== undefined || needle !== undefined;
  store.change(`remove ${kind}`, (document) => {
    if (kind === "level") delete document.level;
    else if (mark !== undefined) document.gauges[index].scale.splice(mark, 1);
    else if (needle !== undefined) document.gauges[index].needles.splice(needle, 1);
    else document[KINDS[kind].list].splice(index, 1);
    if (kind === "reference" && !document.reference_points.length) delete document.reference_points;
  });
  store.select(parent ? { kind, index } : { kind: "panel" });
}

const free = (list, stem, from = 1) => {
  const taken = new Set((list || []).map((item) => item.name));
  let number = from;
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

export function addGauge(store, rim) {
  store.change("gauge", (document) => {
    document.gauges ??= [];
    document.gauges.push({
      name: free(document.gauges, "gauge"),
      centre: rim.centre,
      radius: [rounded(rim.radius * 0.4, 1), rounded(rim.radius, 1)],
      sweep: [135, 405],
      unit: "",
      scale: [],
      needles: [],
    });
  });
  store.select({ kind: "gauge", index: store.document.gauges.length - 1 });
}

// A mark at an angle, in its order along the dial; the sweep grows to hold it. Returns its place.
export function addMark(store, index, angle) {
  let place = 0;
  store.change("mark", (document) => {
    const gauge = document.gauges[index];
    const first = gauge.scale.length ? nearest(angle, (gauge.sweep[0] + gauge.sweep[1]) / 2) : inSweep(angle, gauge.sweep);
    gauge.scale.push([rounded(first, 4), null]);
    gauge.scale.sort((one, other) => one[0] - other[0]);
    place = gauge.scale.findIndex(([each]) => each === rounded(first, 4));
    if (gauge.sweep[1] - gauge.sweep[0] < 360) {
      gauge.sweep = [Math.min(gauge.sweep[0], first), Math.max(gauge.sweep[1], first)].map((each) => rounded(each, 2));
    }
  });
  store.select({ kind: "gauge", index, mark: place });
  return place;
}

export function addNeedle(store, index, { at: angle, span }) {
  store.change("needle", (document) => {
    const gauge = document.gauges[index];
    const taken = new Set(document.gauges.flatMap((each) => (each.needles || []).map((needle) => needle.name)));
    const stem = (gauge.name.replace(/\W+/g, "_").replace(/^[^A-Za-z]+/, "") || "needle") + unitSuffix(gauge.unit);
    let name = stem;
    for (let number = 2; taken.has(name); number += 1) name = `${stem}_${number}`;
    gauge.needles.push({ name, template: { at: rounded(inSweep(angle, gauge.sweep), 4), span } });
  });
  store.select({ kind: "gauge", index, needle: store.document.gauges[index].needles.length - 1 });
}

const UNITS = { "%": "pct", "°C": "c", "deg C": "c", "°F": "f", "deg F": "f", "°": "deg" };

function unitSuffix(unit) {
  const word = (UNITS[unit] ?? unit ?? "").replace(/\W+/g, "_").replace(/^_+|_+$/g, "").toLowerCase();
  return word ? `_${word}` : "";
}

export const sweepEnd = (gauge, end) => at(gauge.centre, gauge.sweep[end], gauge.radius[1]);

// One end of the sweep dragged to a point.
export function dragSweep(gauge, end, point) {
  const angle = rounded(nearest(angleOf(gauge.centre, point), gauge.sweep[end]), 1);
  gauge.sweep[end] = angle;
  if (gauge.sweep[1] <= gauge.sweep[0]) gauge.sweep[1] += 360;
  if (gauge.sweep[1] - gauge.sweep[0] > 360) gauge.sweep[1 - end] = angle + (end ? -360 : 360);
}
