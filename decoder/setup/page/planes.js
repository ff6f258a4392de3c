// How dials are seen: for each the plane-to-plane map from the dial, pixels from its centre, to the panel picture.
// The program works it out from the rim, the reference points and the lens; until it has answered, the dial keeps the
// shape that it had last.
import { RADIANS, rounded, nearest } from "./geometry.js";
import { ask, Lost } from "./server.js";

export class Plane {
  constructor(matrix) {
    this.matrix = matrix;
    const [a, b, c, d, e, f, g, h, i] = matrix;
    this.inverse = [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g, c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d];
  }

  static squareOn([x, y]) {
    return new Plane([1, 0, x, 0, 1, y, 0, 0, 1]);
  }

  carried([a, b, c, d, e, f, g, h, i], [x, y]) {
    const depth = g * x + h * y + i;
    return [(a * x + b * y + c) / depth, (d * x + e * y + f) / depth];
  }

  // A place of the dial in the picture.
  at(angle, radius) {
    return this.carried(this.matrix, [radius * Math.cos(angle * RADIANS), radius * Math.sin(angle * RADIANS)]);
  }

  get centre() {
    return this.at(0, 0);
  }

  // Angle and radius on the dial of a place in the picture.
  polar(point) {
    const [x, y] = this.carried(this.inverse, point);
    return [Math.atan2(y, x) / RADIANS, Math.hypot(x, y)];
  }

  angleOf(point) {
    return this.polar(point)[0];
  }

  // The same plane around another place.
  movedTo([x, y]) {
    const [a, b, c, d, e, f, g, h, i] = this.matrix;
    const [right, down] = [x - c / i, y - f / i];
    return new Plane([a + right * g, b + right * h, c + right * i, d + down * g, e + down * h, f + down * i, g, h, i]);
  }

  // An angle of this dial on another plane, where it stands at the same place of the picture.
  carry(angle, radius, to) {
    return rounded(nearest(to.angleOf(this.at(angle, radius)), angle), 4);
  }

  // The path of an arc of the dial.
  arc(radius, first, last) {
    const steps = Math.max(Math.ceil(Math.min(last - first, 360) / 3), 1);
    const points = Array.from({ length: steps + 1 }, (_, step) => this.at(first + ((last - first) * step) / steps, radius));
    return `M${points.map(([x, y]) => `${x} ${y}`).join("L")}`;
  }
}

const hasPlane = ({ reference_points: points }, { rim }, lens) => Boolean(rim) || lens || (points || []).length >= 3;

export class Planes {
  constructor(store) {
    this.store = store;
    this.known = new Map();
    this.last = new Map(); // by index of the gauge
    store.on("change", () => this.askForMissing());
    this.askForMissing();
  }

  // What the draft tells of how dials are seen.
  get seen() {
    const { focal_length_mm, reference_points, level } = this.store.document;
    return { picture: this.store.now.picture, focal_length_mm, reference_points, level };
  }

  isOblique(gauge) {
    return hasPlane(this.store.document, gauge, this.store.session.lens);
  }

  keyOf({ centre, rim }) {
    return JSON.stringify([this.seen, centre, rim]);
  }

  // A matrix that an answer has brought along.
  keep(gauge, matrix) {
    this.known.set(this.keyOf(gauge), new Plane(matrix));
  }

  of(index, gauge = this.store.document.gauges[index]) {
    if (!this.isOblique(gauge)) return Plane.squareOn(gauge.centre);
    const found = this.known.get(this.keyOf(gauge));
    if (found) this.last.set(index, found);
    return found || this.last.get(index)?.movedTo(gauge.centre) || Plane.squareOn(gauge.centre);
  }

  // The plane of a gauge as it would be drawn, exactly.
  async fetch(gauge) {
    if (!this.isOblique(gauge)) return Plane.squareOn(gauge.centre);
    const { centre, radius, rim } = gauge;
    const { planes } = await ask("planes", { ...this.seen, dials: [{ centre, radius: radius[1], rim }] });
    this.keep(gauge, planes[0]);
    return new Plane(planes[0]);
  }

  async askForMissing() {
    const whole = ({ centre, radius }) => centre && [...centre, ...radius].every(Number.isFinite) && radius[1] > 1;
    const missing = (this.store.document.gauges || []).filter((gauge) => whole(gauge) && this.isOblique(gauge) && !this.known.has(this.keyOf(gauge)));
    const keys = missing.map((gauge) => this.keyOf(gauge));
    const wanted = keys.join();
    if (!missing.length || wanted === this.wanted) return;
    this.wanted = wanted;
    const dials = missing.map(({ centre, radius, rim }) => ({ centre, radius: radius[1], rim }));
    try {
      const { planes } = await ask("planes", { ...this.seen, dials });
      planes.forEach((matrix, place) => this.known.set(keys[place], new Plane(matrix)));
    } catch (error) {
      if (!(error instanceof Lost)) this.store.tell("say", error.message);
      return;
    } finally {
      if (this.wanted === wanted) this.wanted = null;
    }
    this.store.tell("planes");
  }
}
