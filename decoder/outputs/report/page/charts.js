// Charts that are not over time: what the camera's calibration says.
import { content } from "./columns.js";
import { palette } from "./palette.js";

export function drawCharts(state) {
  const charts = content("charts");
  const draw = () => {
    const colours = palette();
    document.querySelectorAll(".chart").forEach((host, place) => drawChart(host, charts[place], colours));
  };
  state.on("style paper", draw);
  draw();
}

function drawChart(host, chart, colours) {
  const axis = (title) => ({ title: { text: plain(title), font: { size: 12, color: colours.quiet } }, gridcolor: colours.line, zeroline: false, linecolor: colours.line, tickfont: { color: colours.quiet, size: 11 }, fixedrange: true, automargin: true });
  const shades = [colours.curve, colours.truth, colours.accent, colours.bad];
  const traces = chart.lines.flatMap(({ name, x, y, low, high }, place) => [
    ...(low ? [{ x: [...x, ...x.toReversed()], y: [...high, ...low.toReversed()], mode: "lines", fill: "toself", fillcolor: colours.band, line: { width: 0 }, hoverinfo: "skip", showlegend: false }] : []),
    { x, y, name: plain(name), mode: "lines", line: { color: shades[place % shades.length], width: 1.6 } },
  ]);
  if (chart.marks) traces.push({ ...chart.marks, name: plain(chart.marks.name), mode: "markers", marker: { size: 9, color: colours.bad, symbol: "diamond" } });
  const layout = {
    width: host.clientWidth, height: 300, margin: { l: 62, r: 14, t: 10, b: 46 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif", color: colours.ink }, xaxis: axis(chart.x), yaxis: axis(chart.y), showlegend: traces.length > 1, legend: { orientation: "h", y: 1.12, font: { size: 11, color: colours.quiet } },
  };
  Plotly.react(host, traces, layout, { displayModeBar: false, responsive: false });
}

// Plotly reads a few tags in its texts; ours have none.
export const plain = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
