// Numbers of places and angles: pixels (x, y), degrees clockwise from the right.
export const RADIANS = Math.PI / 180;

// Whether all of what may be typed, or be missing, is numbers: only then can it be drawn.
export const areNumbers = (...values) => values.flat(Infinity).every(Number.isFinite);

export const distance = ([ax, ay], [bx, by]) => Math.hypot(bx - ax, by - ay);

// The angle, whole turns added or taken off, that lies nearest to another.
export const nearest = (angle, to) => angle - 360 * Math.round((angle - to) / 360);

// The angle brought to where a gauge's sweep is.
export const inSweep = (angle, [first, last]) => nearest(angle, (first + last) / 2);

export const rounded = (value, places = 2) => Number(value.toFixed(places));

// A circle around a gauge, whatever it is: its middle, and how far it reaches; nothing where its place follows from others.
export function around({ centre, radius, window }) {
  if (!window) return centre && radius ? [centre, radius[1]] : null;
  const middle = [0, 1].map((axis) => window.reduce((sum, point) => sum + point[axis] / window.length, 0));
  return [middle, Math.max(...window.map((point) => distance(middle, point)))];
}

const COARSER = 2; // marks between those that have a value are worth half of what all of these are multiples of
const EVEN = 0.2; // of that: an even scale, clicked on its marks, goes by no more

const divisor = (one, other) => (other < 1e-6 ? one : divisor(other, one % other));

// A value that is probably a round one, as those that are known are.
function round(value, known) {
  const unit = known.map(([, each]) => Math.abs(each)).reduce((one, other) => divisor(Math.max(one, other), Math.min(one, other))) / COARSER;
  if (unit <= 1e-6) return null;
  const near = Math.round(value / unit) * unit;
  return Math.abs(value - near) <= EVEN * unit ? Number(near.toPrecision(8)) : null;
}

// The value of a mark on a dial that goes all the way round, by a known one, in units that marks usually are apart.
function onTurn([angle, value], at, turn) {
  const unit = 10 ** Math.floor(Math.log10(turn)) / (turn === 360 ? 20 : 10);
  return { units: ((value + (((at - angle + 720) % 360) * turn) / 360) % turn) / unit, unit };
}

// Whether such a mark stands where a round value is. Seen from aside, marks crowd and draw apart: it may stand at another.
export function isSurelyOnTurn(known, at, turn) {
  const { units } = onTurn(known, at, turn);
  return Math.abs(units - Math.round(units)) <= EVEN;
}

// The value that a mark would have if the scale went on evenly; undefined where nothing tells.
export function suggested(scale, index, turn) {
  const known = scale.filter(([, value], other) => other !== index && typeof value === "number");
  const angle = scale[index][0];
  if (known.length === 1 && typeof turn === "number") {
    const { units, unit } = onTurn(known[0], angle, turn);
    return Number((Math.round(units) * unit).toPrecision(8));
  }
  if (known.length < 2) return undefined;
  const near = [...known].sort((one, other) => Math.abs(one[0] - angle) - Math.abs(other[0] - angle)).slice(0, 2);
  const [[a1, v1], [a2, v2]] = near;
  if (a1 === a2) return undefined;
  const value = v1 + ((angle - a1) * (v2 - v1)) / (a2 - a1);
  const even = round(value, known);
  if (even !== null) return even;
  const step = Math.abs(v2 - v1);
  const unit = step >= 1 ? 10 ** Math.floor(Math.log10(step)) / 10 : 0.01;
  return Number((Math.round(value / unit) * unit).toPrecision(8));
}
