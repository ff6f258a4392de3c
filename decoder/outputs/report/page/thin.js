// Thinning: as much of a curve as the screen has pixels for, and no peak and no flag left out.
import { firstFrom } from "./columns.js";

export const LONG_GAP = 3.5; // so many usual steps without a frame are a gap
const EACH_ROW = 2; // so many rows for each bucket are drawn one by one

// Runs of rows that share a pixel column: [first, end) each. One row beyond either side, so that lines leave the view.
export function buckets(times, from, to, columns) {
  const first = Math.max(firstFrom(times, from) - 1, 0);
  const end = Math.min(firstFrom(times, to) + 1, times.length);
  if (end - first <= columns * EACH_ROW) return Array.from({ length: end - first }, (_, at) => [first + at, first + at + 1]);
  const found = [];
  const width = (to - from) / columns || 1;
  let begun = first;
  let column = Math.floor((times[first] - from) / width);
  for (let row = first + 1; row < end; row++) {
    const here = Math.floor((times[row] - from) / width);
    if (here === column) continue;
    found.push([begun, row]);
    begun = row;
    column = here;
  }
  found.push([begun, end]);
  return found;
}

// Whether so much time went by before a row that frames must be missing there.
const isGap = (times, row, longest) => row > 0 && times[row] - times[row - 1] > longest;

// Of each bucket the rows with the lowest and the highest value, in order; null where there is no value, no frame, or a turn begins anew.
export function peaks(times, values, runs, { wraps, longest }) {
  const rows = [];
  for (const [first, end] of runs) {
    if (isGap(times, first, longest) && rows.length) rows.push(null);
    let low = -1;
    let high = -1;
    for (let row = first; row < end; row++) {
      if (!Number.isFinite(values[row])) continue;
      if (low < 0 || values[row] < values[low]) low = row;
      if (high < 0 || values[row] > values[high]) high = row;
    }
    const before = rows[rows.length - 1];
    if (low < 0) {
      if (before !== null && rows.length) rows.push(null);
      continue;
    }
    if (wraps && before !== undefined && before !== null && Math.abs(values[before] - values[Math.min(low, high)]) > wraps / 2) rows.push(null);
    rows.push(Math.min(low, high));
    if (low !== high) rows.push(Math.max(low, high));
  }
  return rows;
}

// The band as polygons, one for each unbroken stretch: along the upper edge and back along the lower.
export function outline(times, low, high, runs, longest) {
  const x = [];
  const y = [];
  let stretch = [];
  const close = () => {
    if (stretch.length) {
      for (const [time, , top] of stretch) x.push(time), y.push(top);
      for (const [time, bottom] of stretch.reverse()) x.push(time), y.push(bottom);
      x.push(null), y.push(null);
    }
    stretch = [];
  };
  for (const [first, end] of runs) {
    if (isGap(times, first, longest)) close();
    let bottom = Infinity;
    let top = -Infinity;
    for (let row = first; row < end; row++) {
      if (low[row] < bottom) bottom = low[row];
      if (high[row] > top) top = high[row];
    }
    if (bottom > top) close();
    else stretch.push([times[first], bottom, top], ...(end - first > 1 ? [[times[end - 1], bottom, top]] : []));
  }
  close();
  return { x, y };
}

// The rows of one status, at most two of each bucket: its lowest and its highest value.
export function marked(values, status, code, runs) {
  const rows = [];
  for (const [first, end] of runs) {
    let low = -1;
    let high = -1;
    for (let row = first; row < end; row++) {
      if (status[row] !== code || !Number.isFinite(values[row])) continue;
      if (low < 0 || values[row] < values[low]) low = row;
      if (high < 0 || values[row] > values[high]) high = row;
    }
    if (low >= 0) rows.push(low);
    if (high >= 0 && high !== low) rows.push(high);
  }
  return rows;
}

// The stretches of one status as [from, to] times: each frame up to half way to its neighbours, but no further than
// frames usually are apart, and never narrower than `least`; those that touch then are one.
export function stretches(times, status, code, from, to, least, usual) {
  const found = [];
  const end = Math.min(firstFrom(times, to) + 1, times.length);
  for (let row = Math.max(firstFrom(times, from) - 1, 0); row < end; row++) {
    if (status[row] !== code) continue;
    const first = row;
    while (row + 1 < end && status[row + 1] === code && !isGap(times, row + 1, usual * LONG_GAP)) row++;
    let begun = times[first] - Math.min(first ? times[first] - times[first - 1] : usual, usual) / 2;
    let ended = times[row] + Math.min(row + 1 < times.length ? times[row + 1] - times[row] : usual, usual) / 2;
    const missing = Math.max(least - (ended - begun), 0) / 2;
    begun -= missing;
    ended += missing;
    const last = found[found.length - 1];
    if (last && begun <= last[1]) last[1] = ended;
    else found.push([begun, ended]);
  }
  return found;
}

// How far apart frames usually are: the median.
export function usualStep(times) {
  const steps = times.slice(1).map((time, row) => time - times[row]);
  return steps.length ? steps.sort()[steps.length >> 1] : 0;
}
