// The picture under the drawing: zoom, pan, and finer pixels where somebody looks closely.
import { s } from "./dom.js";
import { pictureAddress } from "./server.js";

const LARGEST = 40;
const STEADY_MS = 60;

export class View extends EventTarget {
  constructor(svg, size, key) {
    super();
    this.svg = svg;
    this.whole = s("image", { preserveAspectRatio: "none" });
    this.part = s("image", { preserveAspectRatio: "none" });
    this.layer = s("g");
    svg.append(this.whole, this.part, this.layer);
    this.corner = [0, 0];
    this.scale = 1;
    this.show(size, key);
    new ResizeObserver(() => (this.fitted ? this.fit() : this.place())).observe(svg);
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  // Another picture; one of another size is shown whole.
  show(size, key) {
    const other = !this.size || this.size[0] !== size[0] || this.size[1] !== size[1];
    this.size = size;
    this.key = key;
    for (const [name, value] of Object.entries({ x: -0.5, y: -0.5, width: size[0], height: size[1] })) {
      this.whole.setAttribute(name, value);
    }
    this.whole.setAttribute("href", pictureAddress(key, "whole"));
    this.part.removeAttribute("href");
    if (other) this.fit();
    else this.place();
  }

  get box() {
    const { width, height } = this.svg.getBoundingClientRect();
    return [width || 1, height || 1];
  }

  fit() {
    const [width, height] = this.box;
    this.scale = Math.min(width / this.size[0], height / this.size[1]) * 0.97;
    this.centre([(this.size[0] - 1) / 2, (this.size[1] - 1) / 2]);
    this.fitted = true;
  }

  centre(point, scale = this.scale) {
    this.fitted = false;
    this.scale = Math.min(Math.max(scale, this.smallest), LARGEST);
    this.corner = point.map((value, axis) => value - this.box[axis] / this.scale / 2);
    this.place();
  }

  get smallest() {
    return Math.min(this.box[0] / this.size[0], this.box[1] / this.size[1], 1) * 0.5;
  }

  // Brings a circle into view, large enough to work on.
  closeUp(centre, radius) {
    this.centre(centre, Math.min(...this.box) / (radius * 2.9));
  }

  zoom(factor, about) {
    const middle = about || this.corner.map((value, axis) => value + this.box[axis] / this.scale / 2);
    const scale = Math.min(Math.max(this.scale * factor, this.smallest), LARGEST);
    this.corner = this.corner.map((value, axis) => middle[axis] - ((middle[axis] - value) * this.scale) / scale);
    this.scale = scale;
    this.fitted = false;
    this.place();
  }

  pan(dx, dy) {
    this.fitted = false;
    this.corner = [this.corner[0] - dx / this.scale, this.corner[1] - dy / this.scale];
    this.place();
  }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0016)), this.at(event));
  }

  // Where in the picture a pointer is.
  at(event) {
    const { left, top } = this.svg.getBoundingClientRect();
    return [this.corner[0] + (event.clientX - left) / this.scale, this.corner[1] + (event.clientY - top) / this.scale];
  }

  // Where on the screen a place of the picture is, from the corner of what is shown.
  onScreen(point) {
    return point.map((value, axis) => (value - this.corner[axis]) * this.scale);
  }

  // Moves the view if a point has left it.
  follow([x, y]) {
    const [width, height] = this.box.map((value) => value / this.scale);
    const [left, top] = this.corner;
    if (x < left || y < top || x > left + width || y > top + height) this.centre([x, y]);
  }

  place() {
    const [width, height] = this.box.map((value) => value / this.scale);
    this.svg.setAttribute("viewBox", `${this.corner[0]} ${this.corner[1]} ${width} ${height}`);
    this.whole.style.imageRendering = this.part.style.imageRendering = this.scale > 6 ? "pixelated" : "auto";
    this.dispatchEvent(new Event("place"));
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.sharpen(), STEADY_MS);
  }

  // The part that is seen, in the picture's own pixels; only where the whole view has fewer.
  sharpen() {
    const wanted = this.scale * devicePixelRatio;
    const [width, height] = this.box.map((value) => value / this.scale);
    if (wanted * this.size[0] < 1500 || this.size[0] <= 1600) return;
    const left = Math.max(Math.floor(this.corner[0]), 0);
    const top = Math.max(Math.floor(this.corner[1]), 0);
    const part = {
      left,
      top,
      width: Math.min(Math.ceil(width) + 1, this.size[0] - left),
      height: Math.min(Math.ceil(height) + 1, this.size[1] - top),
    };
    if (part.width <= 0 || part.height <= 0) return;
    const query = new URLSearchParams({ ...part, wanted: Math.ceil(part.width * wanted) });
    const address = `${pictureAddress(this.key, "part")}?${query}`;
    const image = new Image();
    this.latest = address;
    image.onload = () => {
      if (this.latest !== address) return;
      const place = { x: part.left - 0.5, y: part.top - 0.5, width: part.width, height: part.height, href: address };
      for (const [name, value] of Object.entries(place)) this.part.setAttribute(name, value);
      this.dispatchEvent(new Event("sharp"));
    };
    image.src = address;
  }
}
