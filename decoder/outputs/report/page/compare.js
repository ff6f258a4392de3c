// Several parameters in one plot over one time axis; each unit has its own axis of values.
import { byId } from "./dom.js";
import { plain } from "./charts.js";
import { TimePlot } from "./plot.js";
import { LONG_GAP, buckets, peaks } from "./thin.js";

const MOST_AXES = 4;
const AXIS_PART = 0.055; // of the plot's width, for each further axis

export function useCompare(state) {
  const host = byId("compare-plot");
  const boxes = [...document.querySelectorAll("#compare input")];
  const plot = new ManyPlot(host, state, () => ({ at: -1, values: [] }));
  const chosen = () => boxes.filter((box) => box.checked).map((box) => Number(box.value));
  for (const box of boxes) {
    box.addEventListener("change", () => {
      const units = new Set(chosen().map((at) => state.flight.needles[at].unit));
      if (units.size > MOST_AXES) {
        box.checked = false;
        byId("compare-says").textContent = `There is room for ${MOST_AXES} units; remove another one first.`;
        return;
      }
      byId("compare-says").textContent = `${units.size || "No"} ${units.size === 1 ? "axis" : "axes"} of values.`;
      plot.chosen = chosen();
      host.hidden = !plot.chosen.length;
      plot.draw();
    });
  }
}

class ManyPlot extends TimePlot {
  chosen = [];

  units() {
    return [...new Set(this.chosen.map((at) => this.state.flight.needles[at].unit))];
  }

  shade(place, colours) {
    return [colours.curve, colours.truth, colours.accent, colours.bad, colours.status("edge"), colours.status("hidden"), colours.status("interpolated")][place % 7];
  }

  traces(width, colours) {
    const { flight, view } = this.state;
    const longest = this.state.usual * LONG_GAP || Infinity;
    const units = this.units();
    return this.chosen.map((at, place) => {
      const { name, value, wraps, unit } = flight.needles[at];
      const rows = peaks(flight.time_ms, value, buckets(flight.time_ms, ...view, Math.max(Math.round(width - 80), 100)), { wraps, longest });
      const axis = units.indexOf(unit);
      return {
        type: "scatter", mode: "lines", name: plain(`${name}${unit ? `, ${unit}` : ""}`), x: rows.map((row) => (row === null ? null : this.date(flight.time_ms[row]))), y: rows.map((row) => (row === null ? null : value[row])),
        customdata: rows, yaxis: axis ? `y${axis + 1}` : "y", line: { color: this.shade(place, colours), width: 1.5 }, hoverinfo: "none", meta: `many ${name}`,
      };
    });
  }

  layout(width, colours) {
    const units = this.units();
    const [left, right] = [Math.max(Math.ceil(units.length / 2) - 1, 0), Math.max(Math.floor(units.length / 2) - 1, 0)].map((further) => further * AXIS_PART);
    const plain_ = super.layout(width, colours);
    const made = { ...plain_, showlegend: true, legend: { orientation: "h", y: 1.16, font: { size: 11, color: colours.quiet } }, margin: { l: 58, r: units.length > 1 ? 58 : 14, t: 30, b: 22 } };
    made.xaxis = { ...made.xaxis, domain: [left, 1 - right], anchor: "y" };
    units.forEach((unit, place) => {
      const isRight = place % 2 === 1;
      const further = Math.floor(place / 2);
      made[place ? `yaxis${place + 1}` : "yaxis"] = {
        ...plain_.yaxis, domain: [0, 1], range: undefined, autorange: true, title: { text: plain(unit || "no unit"), font: { size: 12, color: colours.quiet } }, automargin: false, showgrid: !place,
        ...(place ? { overlaying: "y", tickmode: "auto", side: isRight ? "right" : "left", anchor: further ? "free" : "x", ...(further ? { position: isRight ? 1 : 0 } : {}) } : {}),
      };
    });
    return made;
  }
}
