// What the program says of a panel, in the words of this page: a key of panel.yaml is called as its field is.
import { kindOf } from "./kinds.js";

const FIELDS = {
  anchors: "Anchors",
  at: "Angle here",
  box: "Left, top, width, height",
  centre: "Centre",
  combined: "One value of several needles",
  covered_by: "Covered by",
  focal_length_mm: "Focal length",
  gauges: "Gauges",
  inches: "Inches",
  level: "Level edge",
  lowest: "Values begin at",
  max_rate: "Fastest change",
  name: "Name",
  needle_height_inches: "Needle height",
  needles: "Needles",
  picture: "Picture file",
  radius: "Radius",
  reference_points: "Reference points",
  rim: "Rim",
  scale: "Tick marks",
  span: "Template spans",
  stops: "Stops",
  sweep: "Sweep",
  tolerance: "Tolerance",
  unit: "Unit",
  window: "corners of the window",
  wraps: "A turn is worth",
};

function labelOf(store, gauge, key) {
  const control = gauge && kindOf(store, gauge).controls.find((each) => each.key === key);
  return control?.label ?? FIELDS[key];
}

// `path` is that of the problem: it tells which gauge's fields are meant.
export function inPagesWords(store, problem, path) {
  const gauge = store.document.gauges?.[/^gauges\[(\d+)\]/.exec(path)?.[1]];
  return problem.replace(/`(\w+): (\w+)`|`([^`]*)`/g, (_, key, value, alone) => {
    const label = labelOf(store, gauge, key ?? alone) ?? key ?? alone;
    return value === undefined ? `“${label}”` : `“${label} ${value}”`;
  });
}

// The same where no field stands beside it: with what it is about in front.
export function wholeSentence(store, problem, path) {
  const words = inPagesWords(store, problem, path);
  const gauge = store.document.gauges?.[/^gauges\[(\d+)\]/.exec(path)?.[1]];
  const key = /(\w+)(?:\[\d+\])*$/.exec(path)?.[1];
  const label = key && labelOf(store, gauge, key);
  return label ? `${label}: ${words}` : words;
}
