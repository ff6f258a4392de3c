// The inspector's fields of a gauge: where it is, what its marks mean, what turns on it.
import { advicePart } from "./advice.js";
import { recentre } from "./dials.js";
import { byId, h } from "./dom.js";
import { check, details, field, input, optionalPair, pair } from "./fields.js";
import { kindOf } from "./kinds.js";
import { needlesPart } from "./needle_part.js";
import { scalePart } from "./scale_part.js";
import { findAxes, pick, unbendRim } from "./tools.js";
import { turningPart } from "./turning_part.js";
import { firstOpen, usualPart } from "./usual.js";

export function gaugePart(store, live, heading) {
  const needles = needlesPart(store, live);

  // A centre that is typed: what was clicked stays where it is in the picture.
  function place(index) {
    const plane = store.planes.of(index);
    return (axis) => (document, value) => {
      const gauge = document.gauges[index];
      if (typeof value !== "number") gauge.centre[axis] = value;
      else recentre(gauge, plane, gauge.centre.map((own, each) => (each === axis ? value : own)));
    };
  }

  // A height that is typed: what stands above the face has its axis elsewhere in the picture.
  const raise = (index) => (document, value) => {
    const gauge = document.gauges[index];
    if (value === undefined) delete gauge.needle_height_inches;
    else gauge.needle_height_inches = value;
    if (typeof value === "number") queueMicrotask(() => findAxes(store, index).catch(() => {}));
  };

  function rim(gauge, index) {
    const path = `gauges[${index}].rim`;
    const bend = h("button", { class: "small", onclick: () => pick(store, "rim") }, "Bend it (E)");
    if (!gauge.rim) {
      const known = (store.document.reference_points || []).length >= 3 ? "by reference points" : "by the lens";
      const seen = store.planes.isOblique(gauge) ? known : "a circle";
      return h("div", { "data-path": path, class: "field" }, h("span", { class: "label" }, "Rim"), h("div", { class: "inputs" }, h("span", { class: "small" }, seen), bend));
    }
    const rows = gauge.rim.map((_, point) =>
      h(
        "div",
        { class: "inputs" },
        ...[0, 1].map((axis) => input(store, `${path}[${point}][${axis}]`, { kind: "number", label: `${"xy"[axis]} of rim point ${point + 1}` })),
        h("button", { class: "remove", "aria-label": `Select rim point ${point + 1}`, title: "Select, to move it with the arrow keys", onclick: () => { store.select({ kind: "gauge", index, rim: point }); pick(store, "select"); } }, "◎"),
      ),
    );
    return [
      h("h3", { "data-path": path }, "Rim, seen from the side"),
      h("div", { class: "inputs" }, bend, " ", h("button", { class: "small", id: "unbend", onclick: () => unbendRim(store, index) }, "Without a rim of its own")),
      details("rim", `${gauge.rim.length} points`, false, ...rows),
    ];
  }

  function more(gauge, index) {
    const path = `gauges[${index}]`;
    const isOpen = Boolean(gauge.stops || gauge.needle_height_inches || gauge.tail);
    return details(
      "more",
      "Stops, height, tail",
      isOpen,
      optionalPair(store, `${path}.stops`, "Stops", ["angle of the first stop", "angle of the last stop"]),
      field("Needle height", input(store, `${path}.needle_height_inches`, { kind: "optional", placeholder: "inches above the face", write: raise(index) })),
      kindOf(store, gauge).along.includes("tail") && check(store, `${path}.tail`, "needles reach across their centre"),
    );
  }

  function corners(index) {
    const path = `gauges[${index}].window`;
    const names = ["top left", "top right", "bottom right", "bottom left"];
    return [
      ...names.map((name, corner) => field(name[0].toUpperCase() + name.slice(1), ...[0, 1].map((axis) => input(store, `${path}[${corner}][${axis}]`, { kind: "number", label: `${"xy"[axis]} of the ${name} corner` })))),
      h("div", { "data-path": path }),
    ];
  }

  return (gauge, index) => {
    const path = `gauges[${index}]`;
    if (gauge.window) {
      return [
        heading(gauge.name || "Window"),
        field("Name", input(store, `${path}.name`)),
        field("Unit", input(store, `${path}.unit`, { placeholder: "such as MHz" })),
        ...corners(index),
        advicePart(store, live, index),
        ...turningPart(store, gauge, index),
      ].flat();
    }
    const write = place(index);
    const centre = [0, 1].map((axis) => input(store, `${path}.centre[${axis}]`, { kind: "number", label: `centre ${"xy"[axis]}`, write: write(axis) }));
    return [
      heading(gauge.name || "Gauge"),
      ...usualPart(store, gauge, index),
      field("Name", input(store, `${path}.name`, { onenter: () => byId(`f:${path}.unit`)?.focus() })),
      field("Unit", input(store, `${path}.unit`, { placeholder: "such as kt", onenter: () => byId(`f:${firstOpen(store, index)}`)?.focus() })),
      field("Centre", ...centre),
      advicePart(store, live, index),
      pair(store, `${path}.radius`, "Radius", ["bottom of the needle", "outer perimeter"]),
      rim(gauge, index),
      pair(store, `${path}.sweep`, "Sweep", ["sweep begins", "sweep ends"]),
      field("A turn is worth", input(store, `${path}.wraps`, { kind: "optional", placeholder: "only if it goes all the way round" })),
      more(gauge, index),
      h("h3", { "data-path": `${path}.scale` }, "Tick marks"),
      ...scalePart(store, path, gauge.scale || [], { kind: "gauge", index }),
      ...turningPart(store, gauge, index),
      ...(gauge.needles ? needles(gauge, index) : []),
    ].flat();
  };
}
