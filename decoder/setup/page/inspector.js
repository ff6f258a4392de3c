// The inspector: the numbers and names of what is selected, to be read and typed.
import { byId, controlNamed, h, nameOf } from "./dom.js";
import { field, input, pair, showProblems } from "./fields.js";
import { gaugePart } from "./gauge_part.js";
import { remove } from "./items.js";
import { pick } from "./tools.js";
import { inPagesWords } from "./words.js";

export function showInspector(store, live, closeUp) {
  const root = byId("inspector");
  let waiting = false;
  let wanted = null;

  const heading = (title, removable = true) =>
    h(
      "header",
      {},
      h("h2", { "data-whole": true }, title),
      h(
        "div",
        {},
        removable && h("button", { class: "small", onclick: closeUp, title: "Close up (F)" }, "Show"),
        removable && h("button", { class: "remove", "aria-label": `Remove ${title}`, title: "Remove (Delete)", onclick: () => remove(store, { kind: store.selection.kind, index: store.selection.index }) }, "×"),
      ),
    );

  const PARTS = {
    gauge: gaugePart(store, live, heading),
    panel() {
      const { session } = store;
      return [
        heading("Panel", false),
        field("Name", input(store, "name")),
        field("Picture file", input(store, "picture")),
        field("Focal length", input(store, "focal_length_mm", { kind: "optional", placeholder: "mm, if known" })),
        h("p", { class: "quiet small" }, session.opened_from ? `Opened from ${session.opened_from}.` : "A new panel."),
        h("h3", {}, "How to draw a panel"),
        h(
          "ol",
          { class: "steps small" },
          h("li", {}, h("b", {}, "Find dials"), " proposes the dials that it finds: accept those that are right, and draw the rest."),
          h("li", {}, "Choose a frame in which no needle overlaps another, below the picture."),
          h("li", {}, h("b", {}, "Anchor"), ": box a knob or a label that is found again in every frame. With one anchor add a ", h("b", {}, "level"), " edge."),
          h("li", {}, "Is the view oblique? ", h("b", {}, "Reference"), ": four places known in inches square up every dial; without them an ", h("b", {}, "ellipse"), " does."),
          h("li", {}, h("b", {}, "Gauge"), ": click three outer ends of tick marks, then drag the ends of the sweep."),
          h("li", {}, h("b", {}, "Tick marks"), ": click them and type their values."),
          h("li", {}, "Accept the needle that is proposed, and look at the filmstrip: is every value right?"),
        ),
      ];
    },
    anchor(anchor, index) {
      const path = `anchors[${index}]`;
      return [
        heading(anchor.name),
        field("Name", input(store, `${path}.name`)),
        field("Left, top", ...[0, 1].map((n) => input(store, `${path}.box[${n}]`, { kind: "number", label: ["left", "top"][n] }))),
        field("Width, height", ...[2, 3].map((n) => input(store, `${path}.box[${n}]`, { kind: "number", label: ["", "", "width", "height"][n] }))),
        h("div", { "data-path": `${path}.box` }),
        h("p", { class: "quiet small" }, "Contrast, sharp edges, and a shape that appears nowhere else on the panel."),
      ];
    },
    level() {
      return [
        heading("Level edge"),
        pair(store, "level[0]", "One end", ["x of one end", "y of one end"]),
        pair(store, "level[1]", "Other end", ["x of the other end", "y of the other end"]),
        h("div", { "data-path": "level" }),
        h("p", { class: "quiet small" }, "An edge that is vertical on the panel; the longer the better."),
      ];
    },
    reference(point, index) {
      const path = `reference_points[${index}]`;
      const next = () => pick(store, "reference");
      return [
        heading("Reference point"),
        pair(store, `${path}.inches`, "Inches", ["inches to the right", "inches down"], { onenter: next }),
        pair(store, `${path}.at`, "Pixels", ["x", "y"]),
        h("p", { class: "quiet small" }, "Places on the panel known in inches, (right, down) from any point. Four or more square up an oblique view."),
      ];
    },
  };

  function draw() {
    waiting = false;
    const { activeElement: active } = document;
    const held = active && root.contains(active) ? { named: nameOf(active), typed: active.tagName === "INPUT" && active.value !== active.dataset.shown ? active.value : null, ends: [active.selectionStart, active.selectionEnd] } : null;
    const top = root.scrollTop;
    const { kind, index } = store.selection;
    const list = { anchor: "anchors", reference: "reference_points", gauge: "gauges" }[kind];
    const item = list ? store.document[list]?.[index] : store.document;
    const whole = list ? `${list}[${index}]` : kind === "level" ? "level" : "";
    root.dataset.drawing = "true"; // a field that is replaced loses the focus, which is no end of typing
    root.replaceChildren(...(item ? PARTS[kind](item, index) : PARTS.panel()).flat().filter(Boolean));
    delete root.dataset.drawing;
    const own = store.problems.filter(({ path }) => (whole ? path.startsWith(whole) : !/^(anchors|gauges|reference_points)\[|^level/.test(path)));
    const failed = kind === "gauge" ? live.resultOf(index)?.error : null;
    showProblems(store, root, own, whole);
    if (failed && !own.length) root.querySelector("[data-whole]").closest("header").after(h("p", { class: "problem" }, inPagesWords(store, failed, whole)));
    root.querySelectorAll(".problem").forEach((problem) => problem.closest("details")?.setAttribute("open", ""));
    root.scrollTop = top;
    const field = wanted ? byId(wanted) : held && controlNamed(root, held.named);
    if (wanted && field) {
      wanted = null;
      field.focus();
      if ("grows" in field.dataset) field.setSelectionRange(field.value.length, field.value.length);
      else field.select?.();
    } else if (held && field) {
      field.focus({ preventScroll: true });
      if (field.tagName === "INPUT" && field.type === "text") {
        if (held.typed !== null) field.value = held.typed; // what is being typed is not lost to a redrawing
        field.setSelectionRange(...held.ends);
      }
    }
  }

  function later() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }

  store.on("change select problems trial", later);
  store.on("type", ({ detail }) => {
    wanted = `f:${detail}`;
    later();
  });
  draw();
}
