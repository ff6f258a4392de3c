import { usualStep } from "./thin.js";

// What the page looks at: the span of time in view, the row that was chosen. Whoever draws listens.
export class State extends EventTarget {
  constructor(flight) {
    super();
    this.flight = flight;
    const times = flight.time_ms;
    const last = times.length ? times[times.length - 1] : 0;
    const margin = Math.max(last * 0.01, 50);
    this.all = [-margin, last + margin];
    this.usual = usualStep(times);
    this.view = [...this.all];
    this.row = -1;
    this.hovered = -1; // the row under the pointer
    this.needle = -1; // the parameter that was asked about
    this.drawing = true;
  }

  tell(what) {
    this.dispatchEvent(new Event(what));
  }

  on(what, listen) {
    for (const name of what.split(" ")) this.addEventListener(name, listen);
  }

  look(from, to) {
    const shortest = 20;
    if (!(to - from >= shortest)) {
      const middle = (from + to) / 2;
      [from, to] = [middle - shortest / 2, middle + shortest / 2];
    }
    const width = Math.min(to - from, this.all[1] - this.all[0]);
    from = Math.min(Math.max(from, this.all[0]), this.all[1] - width);
    this.view = [from, from + width];
    this.tell("view");
  }

  lookAtAll() {
    this.look(...this.all);
  }

  // Nearer (part < 1) or further, around the chosen row if it is in view.
  zoom(part) {
    const [from, to] = this.view;
    const chosen = this.flight.time_ms[this.row];
    const middle = chosen >= from && chosen <= to ? chosen : (from + to) / 2;
    this.look(middle - (middle - from) * part, middle + (to - middle) * part);
  }

  pan(part) {
    const [from, to] = this.view;
    this.look(from + (to - from) * part, to + (to - from) * part);
  }

  choose(row, needle = this.needle) {
    if (!this.flight.rows) return;
    this.needle = needle;
    this.row = Math.min(Math.max(row, 0), this.flight.rows - 1);
    const time = this.flight.time_ms[this.row];
    const [from, to] = this.view;
    if (time < from || time > to) this.look(time - (to - from) / 2, time + (to - from) / 2);
    this.tell("row");
  }

  hover(row) {
    if (row === this.hovered) return;
    this.hovered = row;
    this.tell("hover");
  }

  toggleDrawing() {
    this.drawing = !this.drawing;
    this.tell("row");
  }
}
