// One plot over time: a curve with its 95 % band, every status that is not `read` marked, and a band of all statuses below.
import { LONG_GAP, buckets, marked, outline, peaks, stretches } from "./thin.js";
import { nearestRow } from "./columns.js";
import { palette } from "./palette.js";

const SPARSE = 360; // so many rows in view are drawn as points
const SHAPES = { read: "circle", edge: "diamond", hidden: "square", interpolated: "triangle-up", missing: "x" };
const MARK_PX = 6; // how wide a mark is where rows are not drawn as points
const STRIP_PX = 2.5; // a single frame in the band is at least so wide
const CONFIG = { displayModeBar: false, doubleClick: false, responsive: false, showTips: false };

// A track: values; low and high of the band; status; rings (rows to circle); truth; wraps; it is made when it is first drawn.
export class TimePlot {
  constructor(host, state, makeTrack) {
    Object.assign(this, { host, state, makeTrack, track: null, waiting: false, drawn: false });
    state.on("view row style", () => this.draw());
    state.on("paper", () => this.drawNow()); // on paper all of them are in sight
    this.seen = new Promise((tell) => (this.tellSeen = tell)); // until it is drawn, or known to be out of sight
    new IntersectionObserver(([entry]) => this.see(entry.isIntersecting), { rootMargin: "120px" }).observe(host);
  }

  see(visible) {
    this.visible = visible;
    if (visible && (this.late || !this.drawn)) this.draw();
    else this.tellSeen();
  }

  // Once for each picture of the screen, and only what can be seen.
  draw() {
    this.late = true;
    if (!this.visible || this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.drawNow();
    });
  }

  drawNow() {
    this.late = false;
    this.track ??= this.makeTrack();
    const width = Math.max(this.host.clientWidth, 200);
    const colours = palette();
    Plotly.react(this.host, this.traces(width, colours), this.layout(width, colours), CONFIG);
    if (this.drawn) return;
    this.drawn = true;
    this.tellSeen();
    this.host.on("plotly_relayout", (change) => this.changed(change));
    this.host.on("plotly_doubleclick", () => this.state.lookAtAll());
    this.host.on("plotly_click", (event) => this.clicked(event));
    this.host.addEventListener("mousemove", (event) => this.state.hover(this.rowAt(event)));
    this.host.addEventListener("mouseleave", () => this.state.hover(-1));
  }

  changed(change) {
    const from = change["xaxis.range[0]"];
    const to = change["xaxis.range[1]"];
    if (from !== undefined && to !== undefined) this.state.look(this.fromDate(from), this.fromDate(to));
  }

  // A click on a mark means that frame; beside the marks, the frame nearest in time.
  clicked({ points, event }) {
    const axis = this.host._fullLayout.xaxis;
    const place = this.placeAt(event);
    const mark = points.find((point) => point.data.meta === "mark" && Math.abs(axis.d2p(point.x) - place) < 5);
    this.state.choose(mark ? mark.customdata : this.rowAt(event), this.track.at);
  }

  placeAt = (event) => event.clientX - this.host.getBoundingClientRect().left - this.host._fullLayout.xaxis._offset;

  rowAt(event) {
    return nearestRow(this.state.flight.time_ms, this.fromDate(this.host._fullLayout.xaxis.p2d(this.placeAt(event))));
  }

  fromDate(value) {
    const time = typeof value === "number" ? value : Date.parse(`${String(value).replace(" ", "T")}Z`);
    return time - this.state.flight.start_ms;
  }

  date = (time) => (time === null ? null : this.state.flight.start_ms + time);

  traces(width, colours) {
    const { flight, view } = this.state;
    const { values, low, high, status, truth, wraps } = this.track;
    const times = flight.time_ms;
    if (!times.length) return [];
    const columns = Math.max(Math.round(width - 80), 100);
    const longest = this.state.usual * LONG_GAP || Infinity;
    const runs = buckets(times, ...view, columns);
    const sparse = runs.length <= SPARSE;
    const places = sparse ? runs : buckets(times, ...view, columns / MARK_PX);
    const xs = (rows) => rows.map((row) => (row === null ? null : this.date(times[row])));
    const ys = (of, rows) => rows.map((row) => (row === null ? null : of[row]));
    const curve = (of, more) => {
      const rows = peaks(times, of, runs, { wraps, longest });
      return { type: "scatter", mode: "lines", x: xs(rows), y: ys(of, rows), customdata: rows, hoverinfo: "skip", ...more };
    };
    const made = [];
    if (low) {
      const { x, y } = outline(times, low, high, runs, longest);
      made.push({ type: "scatter", mode: "lines", x: x.map(this.date), y, fill: "toself", fillcolor: colours.band, line: { width: 0 }, hoverinfo: "skip", meta: "band" });
    }
    if (truth) made.push(curve(truth, { line: { color: colours.truth, width: 5 }, opacity: 0.45, meta: "truth" }));
    made.push(curve(values, { line: { color: colours.curve, width: 1.3 }, meta: "curve", hoverinfo: "none" }));
    if (status) {
      flight.statuses.forEach((name, code) => {
        if (name === "missing" || (name === "read" && !sparse)) return;
        const rows = marked(values, status, code, places);
        made.push({
          type: "scatter", mode: "markers", x: xs(rows), y: ys(values, rows), customdata: rows, meta: "mark", hoverinfo: "none",
          marker: { symbol: SHAPES[name], size: name === "read" ? 5 : sparse ? 8 : 6, color: colours.status(name), line: { width: sparse ? 0.8 : 0, color: colours.ink } },
        });
      });
      const rings = (this.track.rings || []).filter((row) => Number.isFinite(values[row]));
      made.push({
        type: "scatter", mode: "markers", x: xs(rings), y: ys(values, rings), customdata: rings, meta: "mark", hoverinfo: "none",
        marker: { symbol: "circle-open", size: 15, color: colours.bad, line: { width: 2, color: colours.bad } },
      });
      made.push(...this.strip((STRIP_PX * (view[1] - view[0])) / columns, colours));
    }
    return made.filter((trace) => trace.x.length);
  }

  // The status of every frame; what is rarer and graver lies on top.
  strip(least, colours) {
    const { flight, view } = this.state;
    return flight.statuses.map((name, code) => {
      const x = [];
      const y = [];
      for (const [from, to] of stretches(flight.time_ms, this.track.status, code, ...view, least, this.state.usual)) {
        x.push(this.date(from), this.date(to), null);
        y.push(0.5, 0.5, null);
      }
      return { type: "scatter", mode: "lines", x, y, yaxis: "y2", line: { color: colours.status(name), width: 7 }, hoverinfo: "skip", meta: `strip ${name}` };
    });
  }

  layout(width, colours) {
    const { flight, view, row } = this.state;
    const grid = { gridcolor: colours.line, zeroline: false, linecolor: colours.line, tickfont: { color: colours.quiet, size: 11 }, fixedrange: true };
    const chosen = row < 0 ? [] : [this.date(flight.time_ms[row])];
    return {
      width, height: this.host.clientHeight || 150, margin: { l: 58, r: 14, t: 6, b: 22 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, hovermode: "x", hoverdistance: -1, dragmode: "zoom",
      font: { family: "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif" },
      xaxis: { ...grid, fixedrange: false, type: "date", range: view.map(this.date), anchor: this.track.status ? "y2" : "y", ticks: "outside", ticklen: 3, tickcolor: colours.line, nticks: 9, ...(flight.start_utc ? {} : { tickformat: "%H:%M:%S.%1f" }) },
      yaxis: { ...grid, domain: [this.track.status ? 0.13 : 0, 1], range: this.extent(), nticks: 5, tickformat: "~r", exponentformat: "none", separatethousands: true },
      ...(this.track.status ? { yaxis2: { domain: [0, 0.06], range: [0, 1], visible: false, fixedrange: true } } : {}),
      shapes: [...(this.track.shaded || []).map(([from, to]) => this.shaded(from, to, colours)), ...chosen.map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: colours.accent, width: 1.5 } }))],
    };
  }

  // A run of rows in which something is amiss; one that is short is still to be seen.
  shaded(first, last, colours) {
    const times = this.state.flight.time_ms;
    const least = (this.state.view[1] - this.state.view[0]) / 200;
    const more = Math.max(least - (times[last] - times[first]), 0) / 2;
    return { type: "rect", layer: "below", x0: this.date(times[first] - more), x1: this.date(times[last] + more), yref: "paper", y0: 0, y1: 1, fillcolor: colours.bad, opacity: 0.18, line: { width: 0 } };
  }

  // All values in view, and of the band so much that it cannot press the curve flat.
  extent() {
    const { values, low, high, truth, least } = this.track;
    const runs = buckets(this.state.flight.time_ms, ...this.state.view, 1);
    let [bottom, top, below, above] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const [first, end] of runs) {
      for (let row = first; row < end; row++) {
        for (const value of [values[row], truth ? truth[row] : NaN]) {
          if (value < bottom) bottom = value;
          if (value > top) top = value;
        }
        if (low && low[row] < below) below = low[row];
        if (high && high[row] > above) above = high[row];
      }
    }
    if (bottom > top) return [0, 1];
    const size = Math.max(top - bottom, least || Math.abs(top) * 1e-6 || 1e-6);
    const middle = (top + bottom) / 2;
    const most = size * 0.9;
    return [
      Math.min(middle - size / 2, Math.max(below, middle - most)) - size * 0.07,
      Math.max(middle + size / 2, Math.min(above, middle + most)) + size * 0.07,
    ];
  }
}
