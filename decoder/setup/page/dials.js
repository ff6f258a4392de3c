// What happens to a gauge's angles when its plane or its centre changes: what was clicked stays where it is in the picture.
import { areNumbers, around, nearest, rounded } from "./geometry.js";
import { changeAngles } from "./kinds.js";

const carriedMarks = (marks, carry) => marks.map(([angle, value]) => [carry(angle), value]);

// Everything of a gauge that was clicked at an angle, on another plane.
function carryAngles(gauge, from, to) {
  const outer = gauge.radius[1];
  const onRim = (angle) => (typeof angle === "number" ? from.carry(angle, outer, to) : angle);
  gauge.scale = carriedMarks(gauge.scale || [], onRim);
  for (const needle of gauge.needles || []) {
    if (needle.scale) needle.scale = carriedMarks(needle.scale, onRim);
    if (typeof needle.template?.at === "number") needle.template.at = from.carry(needle.template.at, outer * 0.7, to);
  }
}

// Around another centre; the rim goes along.
export function recentre(gauge, plane, centre) {
  const [right, down] = centre.map((value, axis) => value - gauge.centre[axis]);
  carryAngles(gauge, plane, plane.movedTo(centre));
  if (gauge.rim) gauge.rim = gauge.rim.map(([x, y]) => [rounded(x + right, 3), rounded(y + down, 3)]);
  gauge.centre = centre.map((value) => rounded(value, 3));
}

// On another plane: its ends and stops go along as well.
export function replane(store, gauge, from, to) {
  const outer = gauge.radius[1];
  carryAngles(gauge, from, to);
  for (const ends of [gauge.sweep, gauge.stops].filter(Boolean)) {
    const span = ends[1] - ends[0];
    const first = rounded(from.carry(ends[0], outer, to), 2);
    const last = span === 360 ? first + 360 : rounded(nearest(from.carry(ends[1], outer, to), ends[1]), 2);
    [ends[0], ends[1]] = [first, last];
  }
  changeAngles(store, gauge, (angle) => from.carry(angle, outer, to));
}

// One end of the sweep dragged to a point.
export function dragSweep(gauge, plane, end, point) {
  const angle = rounded(nearest(plane.angleOf(point), gauge.sweep[end]), 1);
  gauge.sweep[end] = angle;
  if (gauge.sweep[1] <= gauge.sweep[0]) gauge.sweep[1] += 360;
  if (gauge.sweep[1] - gauge.sweep[0] > 360) gauge.sweep[1 - end] = angle + (end ? -360 : 360);
}

// The marks that a selection means: the gauge's, or those of a needle that has its own.
export const marksOf = (gauge, { needle }) => gauge.needles?.[needle]?.scale || gauge.scale || [];

// How far out on a gauge a place of the picture is: less than 1 within it.
export function outOn(store, index, point) {
  const gauge = store.document.gauges[index];
  const { centre, radius, window } = gauge;
  if (window) return areNumbers(window) && isWithin(window, point) ? 0 : Infinity;
  return areNumbers(centre, radius, gauge.rim || []) ? store.planes.of(index).polar(point)[1] / radius[1] : Infinity;
}

const isWithin = (corners, [x, y]) => corners.filter(([ax, ay], place) => {
  const [bx, by] = corners[(place + 1) % corners.length];
  return ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay);
}).length % 2 === 1;

// The gauge that a place of the picture lies within, the smallest if it lies within several; undefined if in none.
export function gaugeAt(store, point) {
  const { gauges = [] } = store.document;
  const there = gauges.map((_, index) => index).filter((index) => outOn(store, index, point) < 1);
  return there.sort((one, other) => around(gauges[one])[1] - around(gauges[other])[1])[0];
}
