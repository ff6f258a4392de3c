// Places and angles on a dial: pixels (x, y), degrees clockwise from the right.
export const RADIANS = Math.PI / 180;

export const at = ([x, y], angle, radius) => [
  x + radius * Math.cos(angle * RADIANS),
  y + radius * Math.sin(angle * RADIANS),
];

export const angleOf = ([cx, cy], [x, y]) => Math.atan2(y - cy, x - cx) / RADIANS;

export const distance = ([ax, ay], [bx, by]) => Math.hypot(bx - ax, by - ay);

// The angle, whole turns added or taken off, that lies nearest to another.
export const nearest = (angle, to) => angle - 360 * Math.round((angle - to) / 360);

// The angle brought to where a gauge's sweep is.
export const inSweep = (angle, [first, last]) => nearest(angle, (first + last) / 2);

export const rounded = (value, places = 2) => Number(value.toFixed(places));

export function arc(centre, radius, first, last) {
  const [x1, y1] = at(centre, first, radius);
  if (last - first >= 359.999) {
    const [x2, y2] = at(centre, first + 180, radius);
    return `M${x1} ${y1}A${radius} ${radius} 0 1 1 ${x2} ${y2}A${radius} ${radius} 0 1 1 ${x1} ${y1}`;
  }
  const [x2, y2] = at(centre, last, radius);
  return `M${x1} ${y1}A${radius} ${radius} 0 ${last - first > 180 ? 1 : 0} 1 ${x2} ${y2}`;
}

// A gauge around another centre: what was clicked in the picture stays where it is there.
export function recentre(gauge, centre) {
  const outer = gauge.radius[1];
  const carried = (angle, radius) => rounded(nearest(angleOf(centre, at(gauge.centre, angle, radius)), angle), 4);
  gauge.scale = (gauge.scale || []).map(([angle, value]) => [carried(angle, outer), value]);
  for (const needle of gauge.needles || []) {
    if (needle.scale) needle.scale = needle.scale.map(([angle, value]) => [carried(angle, outer), value]);
    if (typeof needle.template?.at === "number") needle.template.at = carried(needle.template.at, outer * 0.7);
  }
  gauge.centre = centre.map((value) => rounded(value, 3));
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
