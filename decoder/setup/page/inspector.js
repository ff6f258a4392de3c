// The inspector: the numbers and names of what is selected, to be read and typed.
import { byId, h } from "./dom.js";
import { check, choice, field, input, showProblems } from "./fields.js";
import { rounded, recentre, suggested } from "./geometry.js";
import { addNeedle, remove } from "./items.js";
import { ask, TAB } from "./server.js";
import { axisAt, pick } from "./tools.js";

const REASONS = { read: "read", edge: "read by an edge", hidden: "hidden", missing: "missing" };

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

  const pair = (path, label, names, options) =>
    field(label, ...[0, 1].map((end) => input(store, `${path}[${end}]`, { kind: "number", label: names[end], ...options })));

  const PARTS = {
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
          h("li", {}, "Choose a frame with the needles apart from each other, below the picture."),
          h("li", {}, h("b", {}, "Anchor"), ": box a knob or a label that is found again in every frame. With one anchor add a ", h("b", {}, "level"), " edge."),
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
        h("p", { class: "quiet small" }, "Contrast, sharp edges, and a shape that stands nowhere else on the panel."),
      ];
    },
    level() {
      return [
        heading("Level edge"),
        pair("level[0]", "One end", ["x of one end", "y of one end"]),
        pair("level[1]", "Other end", ["x of the other end", "y of the other end"]),
        h("div", { "data-path": "level" }),
        h("p", { class: "quiet small" }, "An edge that is vertical on the panel; the longer the better."),
      ];
    },
    reference(point, index) {
      const path = `reference_points[${index}]`;
      const next = () => pick(store, "reference");
      return [
        heading("Reference point"),
        pair(`${path}.inches`, "Inches", ["inches to the right", "inches down"], { onenter: next }),
        pair(`${path}.at`, "Pixels", ["x", "y"]),
        h("p", { class: "quiet small" }, "Places on the panel known in inches, (right, down) from any point. Four or more square up an oblique view."),
      ];
    },
    gauge(gauge, index) {
      const path = `gauges[${index}]`;
      const { selection } = store;
      return [
        heading(gauge.name || "Gauge"),
        isOblique(gauge)
          ? h("p", { class: "card small" }, "This dial is squared up (rim or reference points), so its angles are those of the dial seen square on. The drawing here does not lean with it: trust the values, and type angles rather than clicking them.")
          : null,
        field("Name", input(store, `${path}.name`)),
        field("Unit", input(store, `${path}.unit`, { placeholder: "such as kt" })),
        field("Centre", ...[0, 1].map((axis) => input(store, `${path}.centre[${axis}]`, { kind: "number", label: `centre ${"xy"[axis]}`, write: (document, value) => place(document.gauges[index], axis, value) }))),
        pivot(gauge, index),
        pair(`${path}.radius`, "Radius", ["bottom of the needle", "outer perimeter"]),
        pair(`${path}.sweep`, "Sweep", ["sweep begins", "sweep ends"]),
        field("A turn is worth", input(store, `${path}.wraps`, { kind: "optional", placeholder: "only if it goes all the way round" })),
        ...scale(gauge, index, selection),
        ...needles(gauge, index, selection),
      ];
    },
  };

  // Whether the decoder reads a gauge in a plane of its own.
  const isOblique = (gauge) => Boolean(gauge.rim) || (store.document.reference_points || []).length >= 3;

  function place(gauge, axis, value) {
    if (typeof value !== "number") gauge.centre[axis] = value;
    else recentre(gauge, gauge.centre.map((own, each) => (each === axis ? value : own)));
  }

  function pivot(gauge, index) {
    const moved = live.resultOf(index)?.moved;
    if (!moved || Math.hypot(...moved) < 0.05) return null;
    const words = `The needle turns ${rounded(Math.abs(moved[0]))} px ${moved[0] < 0 ? "left" : "right"}, ${rounded(Math.abs(moved[1]))} px ${moved[1] < 0 ? "above" : "below"} of there.`;
    const there = gauge.centre.map((value, axis) => value + moved[axis]);
    return h(
      "div",
      { class: "card offer small" },
      h("p", {}, words),
      h("button", { id: "usepivot", onclick: () => store.change("pivot", (document) => recentre(document.gauges[index], there)) }, "Move the centre there"),
    );
  }

  function scale(gauge, index, selection) {
    const path = `gauges[${index}].scale`;
    const rows = (gauge.scale || []).map(([angle], mark) => {
      const guess = suggested(gauge.scale, mark);
      const accept = (text) => {
        if (text.trim() === "" && guess !== undefined) store.change(`type ${path}[${mark}][1]`, (document) => { document.gauges[index].scale[mark][1] = guess; });
        if (store.tool === "mark") byId("picture").focus();
        else byId(`f:${path}[${mark + 1}][1]`)?.focus();
      };
      return h(
        "tr",
        { class: selection.mark === mark ? "chosen" : "" },
        h("td", {}, input(store, `${path}[${mark}][1]`, { kind: "number", label: `value of the mark at ${angle} degrees`, placeholder: guess === undefined ? "value" : `${guess}?`, onenter: accept })),
        h("td", {}, input(store, `${path}[${mark}][0]`, { kind: "number", label: `angle of mark ${mark + 1}` })),
        h("td", {}, h("button", { class: "remove", "aria-label": `Remove mark ${mark + 1}`, onclick: () => remove(store, { kind: "gauge", index, mark }) }, "×")),
      );
    });
    return [
      h("h3", { "data-path": path }, "Tick marks"),
      rows.length ? h("table", {}, h("tr", {}, h("th", {}, "Value"), h("th", {}, "Angle, degrees"), h("th")), ...rows) : h("p", { class: "quiet small" }, "None yet. Two are enough for an even scale."),
      h("button", { class: "small", onclick: () => pick(store, "mark") }, "Add tick marks (T)"),
    ];
  }

  function needles(gauge, index, selection) {
    const cards = (gauge.needles || []).map((needle, place) => {
      const path = `gauges[${index}].needles[${place}]`;
      const others = gauge.needles.filter((each) => each !== needle).map(({ name }) => [name, name]);
      return h(
        "div",
        { class: `card ${selection.needle === place ? "chosen" : ""}`, "data-path": path },
        h("div", { class: "row" }, h("b", {}, needle.name), h("button", { class: "remove", "aria-label": `Remove needle ${needle.name}`, onclick: () => remove(store, { kind: "gauge", index, needle: place }) }, "×")),
        field("Name", input(store, `${path}.name`)),
        field("Angle here", input(store, `${path}.template.at`, { kind: "optional" })),
        field("Template spans", input(store, `${path}.template.span`, { kind: "optional" })),
        others.length ? field("Covered by", choice(store, `${path}.covered_by`, [["", "no other needle"], ...others], "Covered by")) : null,
        typeof needle.template?.at === "number" && h("button", { class: "small", onclick: () => snap(index, place) }, "Find its axis again"),
        h("p", { class: "quiet small" }, verdict(index, needle.name)),
      );
    });
    const offers = store.offers.get(offerKey(index)) || null;
    return [
      h("h3", { "data-path": `gauges[${index}].needles` }, "Needles"),
      ...cards,
      ...(cards.length ? [] : proposals(index, offers)),
      h(
        "div",
        { class: "inputs" },
        h("button", { class: "small", onclick: () => pick(store, "needle") }, "Point at a needle (N)"),
        " ",
        cards.length > 0 && h("button", { class: "small", onclick: () => offerMore(index) }, "Look for others"),
      ),
      ...(cards.length && offers ? proposals(index, offers.filter(({ at }) => !gauge.needles.some(({ template }) => Math.abs((((template?.at ?? 1e9) - at + 540) % 360) - 180) < 5))) : []),
      cards.length > 0 && check(store, `gauges[${index}].tail`, "needles reach across their centre"),
    ];
  }

  // What proposals depend on.
  const offerKey = (index) => {
    const { centre, radius } = store.document.gauges[index];
    return JSON.stringify([store.now.picture, centre, radius]);
  };

  function proposals(index, offers) {
    if (!offers) {
      offerMore(index);
      return [h("p", { class: "quiet small" }, "Looking for what moves on this dial …")];
    }
    if (!offers.length) return [h("p", { class: "quiet small" }, "Nothing more was seen to move here; point at the needle, or crop it on the unwrapped gauge.")];
    return offers.map((offer, place) =>
      h(
        "div",
        { class: "card offer row-card" },
        h("div", { class: "row" }, h("span", {}, `A needle at ${rounded(offer.at, 1)}°`), h("button", { class: "main accept", id: `accept-${place}`, onclick: () => accept(index, offer) }, "Accept")),
      ),
    );
  }

  function accept(index, offer) {
    addNeedle(store, index, offer);
  }

  async function offerMore(index) {
    const key = offerKey(index);
    if (store.offers.has(key)) return;
    const { centre, radius, sweep } = store.document.gauges[index];
    const { document, picture } = store.now;
    store.offers.set(key, null);
    try {
      const found = await ask("needles", { document, picture, centre, radius, sweep, tab: `${TAB}-${index}` });
      store.offers.set(key, found?.needles || []);
    } catch {
      store.offers.delete(key);
      return;
    }
    store.tell("trial");
  }

  async function snap(index, needle) {
    store.select({ kind: "gauge", index, needle });
    const angle = await axisAt(store, store.gauge.needles[needle].template.at);
    store.change("axis", (document) => { document.gauges[index].needles[needle].template.at = angle; });
  }

  function verdict(index, name) {
    const result = live.resultOf(index);
    if (!result) return live.keyOf(index) ? "Reading …" : "It is read as soon as there are an anchor and two marks.";
    if (result.error) return "";
    const seen = result.frames.flatMap((frame) => frame.needles.filter((needle) => needle.name === name));
    const counts = Object.entries(REASONS).map(([status, words]) => [seen.filter((each) => each.status === status).length, words]);
    const lowest = seen.length ? Math.min(...seen.map(({ score }) => score)) : 0;
    const lost = result.frames.length - seen.length;
    const words = counts.filter(([count]) => count).map(([count, what]) => `${count} ${what}`);
    return [...words, lost ? `panel not found in ${lost}` : "", `lowest score ${lowest.toFixed(2)}`].filter(Boolean).join(", ");
  }

  function draw() {
    waiting = false;
    const { activeElement: active } = document;
    const held = active && root.contains(active) && active.id ? { id: active.id, typed: active.tagName === "INPUT" && active.value !== active.dataset.shown ? active.value : null, ends: [active.selectionStart, active.selectionEnd] } : null;
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
    showProblems(root, own, whole);
    if (failed && !own.length) root.querySelector("[data-whole]").closest("header").after(h("p", { class: "problem" }, failed));
    root.scrollTop = top;
    const field = wanted ? byId(wanted) : held && byId(held.id);
    if (wanted && field) {
      wanted = null;
      field.focus();
      field.select?.();
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
