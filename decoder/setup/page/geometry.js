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

// The value that a mark would have if the scale went on evenly; undefined where nothing tells.
export function suggested(scale, index) {
  const known = scale.filter(([, value], other) => other !== index && typeof value === "number");
  if (known.length < 2) return undefined;
  const angle = scale[index][0];
  const near = [...known].sort((one, other) => Math.abs(one[0] - angle) - Math.abs(other[0] - angle)).slice(0, 2);
  const [[a1, v1], [a2, v2]] = near;
  if (a1 === a2) return undefined;
  const value = v1 + ((angle - a1) * (v2 - v1)) / (a2 - a1);
  const step = Math.abs(v2 - v1);
  const unit = step >= 1 ? 10 ** Math.floor(Math.log10(step)) / 10 : 0.01;
  return Number((Math.round(value / unit) * unit).toPrecision(8));
}
