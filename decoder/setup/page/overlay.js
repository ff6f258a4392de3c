// The drawing over the panel picture: everything in the picture's own pixels, lines as thick at every zoom.
import { s } from "./dom.js";
import { dragSweep, marksOf, recentre } from "./dials.js";
import { areNumbers, rounded } from "./geometry.js";

export class Overlay {
  constructor(store, view) {
    this.store = store;
    this.view = view;
    this.grips = new WeakMap();
    this.draw = this.draw.bind(this);
    store.on("change select tool cursor looking planes", this.draw);
    view.addEventListener("place", this.draw);
  }

  // An element that selects something, and perhaps moves it: `drag(document, point)` changes the draft.
  grip(element, selection, drag) {
    this.grips.set(element, { selection, drag });
    return element;
  }

  gripOf(element) {
    for (let each = element; each && each !== this.view.svg; each = each.parentNode) {
      if (this.grips.has(each)) return this.grips.get(each);
    }
    return null;
  }

  get unit() {
    return 1 / this.view.scale;
  }

  draw() {
    const { document, looking } = this.store;
    this.view.layer.setAttribute("class", looking ? "dimmed" : "");
    this.view.layer.replaceChildren(
      ...(document.anchors || []).map((anchor, index) => (areNumbers(anchor.box) ? this.anchor(anchor, index) : "")),
      ...(document.level && areNumbers(document.level) ? [this.level(document.level)] : []),
      ...(document.reference_points || []).map((point, index) => (areNumbers(point.at) ? this.reference(point, index) : "")),
      ...(document.gauges || []).map((gauge, index) => (this.isWhole(gauge) ? this.gauge(gauge, index) : "")),
      ...this.pending(),
    );
  }

  isWhole({ centre, radius, sweep, rim, window }) {
    return window ? areNumbers(window) : areNumbers(centre, radius, sweep, rim || []);
  }

  chosen(kind, index) {
    const { selection } = this.store;
    return selection.kind === kind && selection.index === index ? "chosen" : "";
  }

  text(words, [x, y], { size = 12, anchor = "middle" } = {}) {
    const unit = this.unit;
    const label = s("text", { x, y, "font-size": size * unit, "stroke-width": 3 * unit, "text-anchor": anchor });
    label.textContent = words;
    return label;
  }

  handle([x, y], selection, drag) {
    return this.grip(s("circle", { class: "handle", cx: x, cy: y, r: 5 * this.unit }), selection, drag);
  }

  line([x1, y1], [x2, y2], name = "shape") {
    return s("line", { x1, y1, x2, y2, class: name });
  }

  anchor({ name, box }, index) {
    const [x, y, width, height] = box;
    const selection = { kind: "anchor", index };
    const chosen = this.chosen("anchor", index);
    const rect = { x: x - 0.5, y: y - 0.5, width, height };
    const move = (document, [px, py], grabbed) => {
      document.anchors[index].box[0] = Math.round(px - grabbed[0] + box[0]);
      document.anchors[index].box[1] = Math.round(py - grabbed[1] + box[1]);
    };
    const resize = (document, [px, py]) => {
      const own = document.anchors[index].box;
      own[2] = Math.max(Math.round(px - own[0]), 8);
      own[3] = Math.max(Math.round(py - own[1]), 8);
    };
    return s(
      "g",
      { class: `anchor ${chosen}` },
      s("rect", { ...rect, class: "halo" }),
      s("rect", { ...rect, class: "shape" }),
      this.grip(s("rect", { ...rect, class: "hit" }), selection, move),
      this.text(name, [x + width / 2, y - 5 * this.unit]),
      chosen && this.handle([x + width, y + height], selection, resize),
    );
  }

  level(ends) {
    const chosen = this.store.selection.kind === "level";
    const drag = (end) => (document, point) => {
      document.level[end] = point.map((value) => rounded(value, 1));
    };
    return s(
      "g",
      { class: `level ${chosen ? "chosen" : ""}` },
      this.line(...ends, "halo"),
      this.line(...ends),
      this.grip(this.line(...ends, "hit"), { kind: "level" }),
      this.text("level", [ends[0][0] + 8 * this.unit, ends[0][1]], { anchor: "start" }),
      ...[0, 1].map((end) => chosen && this.handle(ends[end], { kind: "level", end }, drag(end))),
    );
  }

  reference({ at: [x, y], inches }, index) {
    const r = 7 * this.unit;
    const drag = (document, point) => {
      document.reference_points[index].at = point.map((value) => rounded(value, 2));
    };
    const path = { d: `M${x - r} ${y}h${2 * r}M${x} ${y - r}v${2 * r}` };
    return s(
      "g",
      { class: `reference ${this.chosen("reference", index)}` },
      s("path", { ...path, class: "halo" }),
      s("path", { ...path, class: "shape" }),
      this.grip(s("circle", { cx: x, cy: y, r, class: "hit" }), { kind: "reference", index }, drag),
      this.text(inches.map((each) => each ?? "?").join(", ") + " in", [x + r * 1.4, y - r * 0.6], { anchor: "start", size: 11 }),
    );
  }

  window({ name, window }, index) {
    const chosen = this.chosen("gauge", index);
    const outline = { points: window.map((point) => point.join()).join(" ") };
    const whole = { kind: "gauge", index };
    const move = (document, [px, py], grabbed) => {
      document.gauges[index].window = window.map(([x, y]) => [rounded(x + px - grabbed[0]), rounded(y + py - grabbed[1])]);
    };
    const drag = (corner) => (document, point) => {
      document.gauges[index].window[corner] = point.map((value) => rounded(value));
    };
    const [[x, y], [right]] = window;
    return s(
      "g",
      { class: `gauge window ${chosen}` },
      s("polygon", { ...outline, class: "halo" }),
      s("polygon", { ...outline, class: "shape" }),
      this.grip(s("polygon", { ...outline, class: "hit" }), whole, move),
      !chosen && this.text(name, [(x + right) / 2, y - 5 * this.unit]),
      ...(chosen ? window.map((point, corner) => this.handle(point, { ...whole, corner }, drag(corner))) : []),
    );
  }

  gauge(gauge, index) {
    if (gauge.window) return this.window(gauge, index);
    const { radius, sweep } = gauge;
    const { selection } = this.store;
    const chosen = this.chosen("gauge", index);
    const whole = { kind: "gauge", index };
    const plane = this.store.planes.of(index, gauge);
    const rim = { d: plane.arc(radius[1], ...sweep) };
    return s(
      "g",
      { class: `gauge ${chosen}` },
      s("path", { ...rim, class: "halo" }),
      s("path", { ...rim, class: "shape" }),
      chosen && s("path", { d: plane.arc(radius[0], ...sweep), class: "shape thin" }),
      this.grip(s("path", { d: plane.arc(radius[1], 0, 360), class: "hit" }), whole),
      ...(chosen ? this.marks(gauge, index, plane) : []),
      ...(gauge.needles || []).map((needle, place) => this.needle(gauge, index, needle, place, plane)),
      !chosen && this.text(gauge.name, plane.at(90, radius[1] + 14 * this.unit)),
      ...(chosen ? this.handles(gauge, index, plane) : []),
      chosen && selection.mark === undefined && selection.needle === undefined && selection.rim === undefined && this.crossAt(gauge.centre),
    );
  }

  crossAt([x, y]) {
    const r = 6 * this.unit;
    return s("path", { d: `M${x - r} ${y}h${2 * r}M${x} ${y - r}v${2 * r}`, class: "shape chosen" });
  }

  // The marks of the gauge, or of the selected needle that has its own.
  marks(gauge, index, plane) {
    const { needle } = this.store.selection;
    const own = gauge.needles?.[needle]?.scale ? { needle } : {};
    return marksOf(gauge, own).map((mark, place) => areNumbers(mark[0]) && this.mark(gauge.radius[1], mark, { kind: "gauge", index, mark: place, ...own }, plane));
  }

  mark(outer, [angle, value], selection, plane) {
    const ends = [plane.at(angle, outer * 0.9), plane.at(angle, outer * 1.06)];
    const own = this.store.selection.mark === selection.mark ? "chosen" : "";
    const [x, y] = plane.at(angle, outer * 1.08 + 13 * this.unit);
    return s(
      "g",
      { class: `mark ${own}` },
      this.line(...ends, "halo"),
      this.line(...ends, `shape ${own}`),
      this.grip(this.line(...ends, "hit"), selection),
      this.text(value ?? "?", [x, y + 4 * this.unit], { size: own ? 14 : 12 }),
    );
  }

  needle({ radius }, index, { template }, place, plane) {
    if (typeof template?.at !== "number") return s("g");
    const ends = [plane.at(template.at, radius[0]), plane.at(template.at, radius[1])];
    const name = `shape needle ${place % 2 ? "other" : ""}`;
    return s(
      "g",
      {},
      this.line(...ends, "halo"),
      this.line(...ends, name),
      this.grip(this.line(...ends, "hit"), { kind: "gauge", index, needle: place }),
    );
  }

  handles(gauge, index, plane) {
    const whole = { kind: "gauge", index };
    const { centre, radius, sweep } = gauge;
    const middle = sweep[0] + (sweep[1] - sweep[0]) * 0.31;
    const { dragCentre, dragRadius, dragEnd } = this.drags(index);
    return [
      this.handle(centre, whole, dragCentre),
      this.handle(plane.at(middle, radius[0]), whole, dragRadius(0)),
      this.handle(plane.at(middle, radius[1]), whole, dragRadius(1)),
      ...[0, 1].map((end) => this.handle(plane.at(sweep[end], radius[1]), whole, dragEnd(end))),
      ...(gauge.rim || []).map((point, rim) => this.rimPoint(point, { kind: "gauge", index, rim })),
    ];
  }

  rimPoint([x, y], selection) {
    const r = 4 * this.unit;
    const chosen = this.store.selection.rim === selection.rim ? "chosen" : "";
    const drag = (document, point) => {
      document.gauges[selection.index].rim[selection.rim] = point.map((value) => rounded(value, 2));
    };
    return this.grip(s("rect", { class: `handle rim ${chosen}`, x: x - r, y: y - r, width: 2 * r, height: 2 * r }), selection, drag);
  }

  drags(index) {
    const planeOf = (document) => this.store.planes.of(index, document.gauges[index]);
    return {
      dragCentre: (document, point) => recentre(document.gauges[index], planeOf(document), point),
      dragRadius: (which) => (document, point) => {
        const { radius } = document.gauges[index];
        const length = rounded(planeOf(document).polar(point)[1], 1);
        radius[which] = which ? Math.max(length, radius[0] + 2) : Math.min(Math.max(length, 1), radius[1] - 2);
      },
      dragEnd: (end) => (document, point) => dragSweep(document.gauges[index], planeOf(document), end, point),
    };
  }

  pending() {
    const { bends, clicks, cursor, tool } = this.store;
    if (tool === "select") return [];
    const unit = this.unit;
    const dots = [...bends, ...clicks].map(([x, y]) => s("circle", { cx: x, cy: y, r: 4 * unit, class: "handle" }));
    const [x, y] = cursor;
    const r = 14 * unit;
    dots.push(s("path", { class: "cross", d: `M${x - r} ${y}h${r * 0.7}M${x + r} ${y}h${-r * 0.7}M${x} ${y - r}v${r * 0.7}M${x} ${y + r}v${-r * 0.7}` }));
    if (clicks.length && tool === "anchor") {
      const [[ax, ay]] = clicks;
      dots.push(s("rect", { class: "shape", x: Math.min(ax, x), y: Math.min(ay, y), width: Math.abs(x - ax), height: Math.abs(y - ay) }));
    }
    if (clicks.length && tool === "level") dots.push(this.line(clicks[0], cursor));
    return dots;
  }
}
