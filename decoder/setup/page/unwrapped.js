// The unwrapped gauge, lying on its side: angle to the right, radius upwards; marks and needles drawn on it.
import { marksOf } from "./dials.js";
import { byId, h, s } from "./dom.js";
import { areNumbers, rounded } from "./geometry.js";
import { addNeedle } from "./items.js";
import { ask, Lost, TAB } from "./server.js";
import { axisAt, placeMark } from "./tools.js";

const MIN_SPAN_DEG = 4;

export function showUnwrapped(store) {
  const root = byId("unwrapped");
  const image = h("img", { alt: "The selected gauge unwrapped: angle to the right, radius upwards" });
  const drawing = s("svg", { role: "img", "aria-label": "Tick marks and needles on the unwrapped gauge" });
  const blank = h("p", { class: "blank" }, "Select a gauge to see it unwrapped.");
  root.append(image, drawing, blank);
  let shown = null; // what the image covers
  let asked = "";
  let next = null; // the question that waits
  let busy = false;
  let crop = null;

  const x = (angle) => ((angle - shown.start) / (shown.end - shown.start)) * drawing.clientWidth;
  const y = (radius) => (1 - (radius - shown.inner) / (shown.outer - shown.inner)) * drawing.clientHeight;
  const angleAt = (event) => {
    const { left, width } = drawing.getBoundingClientRect();
    return shown.start + ((event.clientX - left) / width) * (shown.end - shown.start);
  };
  const radiusAt = (event) => {
    const { top, height } = drawing.getBoundingClientRect();
    return shown.outer - ((event.clientY - top) / height) * (shown.outer - shown.inner);
  };

  function draw() {
    const { gauge, selection } = store;
    image.hidden = blank.hidden = true;
    drawing.toggleAttribute("hidden", true); // an SVG has no property for it
    if (!gauge || !shown || !areNumbers(gauge.sweep, gauge.radius)) {
      blank.hidden = Boolean(gauge);
      return;
    }
    image.hidden = false;
    drawing.toggleAttribute("hidden", false);
    const height = drawing.clientHeight;
    const upright = (angle, name) => s("line", { x1: x(angle), x2: x(angle), y1: 0, y2: height, class: name });
    const label = (words, angle) => {
      const text = s("text", { x: x(angle), y: 12, "text-anchor": "middle" });
      text.textContent = words;
      return text;
    };
    const [first, last] = gauge.sweep;
    drawing.replaceChildren(
      s("rect", { class: "beyond", x: 0, y: 0, width: Math.max(x(first), 0), height }),
      s("rect", { class: "beyond", x: x(last), y: 0, width: Math.max(drawing.clientWidth - x(last), 0), height }),
      s("line", { class: "shape thin", x1: 0, x2: drawing.clientWidth, y1: y(gauge.radius[1]), y2: y(gauge.radius[1]) }),
      ...(gauge.needles || []).flatMap(({ template }, place) => {
        if (typeof template?.at !== "number") return [];
        const name = place % 2 ? "other" : "";
        const half = (areNumbers(template.span) ? template.span : 16) / 2;
        return [
          s("rect", { class: `band ${name}`, x: x(template.at - half), width: x(template.at + half) - x(template.at - half), y: y(gauge.radius[1]), height }),
          upright(template.at, `shape needle ${name}`),
        ];
      }),
      ...(gauge.stops || []).filter(Number.isFinite).map((angle) => upright(angle, "shape stop")),
      ...marksOf(gauge, selection).flatMap(([angle, value], mark) => areNumbers(angle) ? [
        upright(angle, `shape thin ${selection.mark === mark ? "chosen" : ""}`),
        label(value ?? "?", angle),
      ] : []),
      ...(crop ? [s("rect", { class: "band", x: Math.min(x(crop.from), x(crop.to)), width: Math.abs(x(crop.to) - x(crop.from)), y: 0, height })] : []),
    );
  }

  // First the question, whose answer takes longest; then what can be drawn at once.
  function follow() {
    fetchLater();
    draw();
  }

  function fetchLater() {
    const { gauge } = store;
    if (!gauge || !areNumbers(gauge.centre, gauge.radius, gauge.sweep)) return;
    const { centre, radius, sweep, rim } = gauge;
    const question = { ...store.planes.seen, centre, radius, sweep, rim, tab: TAB };
    const key = JSON.stringify(question);
    if (key === asked) return;
    asked = key;
    next = question;
    if (!busy) fetchNext();
  }

  // One question at a time, at once; of those that come meanwhile only the last counts.
  async function fetchNext() {
    busy = true;
    while (next) {
      const question = next;
      next = null;
      try {
        const answer = await ask("unwrap", question);
        if (next) continue;
        shown = answer;
        image.src = answer.image;
        await image.decode().catch(() => {});
        draw();
      } catch (error) {
        asked = "";
        if (!(error instanceof Lost)) store.tell("say", error.message);
      }
    }
    busy = false;
  }

  drawing.addEventListener("pointerdown", (event) => {
    crop = { from: angleAt(event), to: angleAt(event) };
    drawing.setPointerCapture(event.pointerId);
  });
  drawing.addEventListener("pointermove", (event) => {
    if (!crop) return;
    crop.to = angleAt(event);
    draw();
  });
  drawing.addEventListener("pointerup", async (event) => {
    const { from, to } = crop || { from: 0, to: 0 };
    crop = null;
    const span = rounded(Math.abs(to - from), 1);
    try {
      if (span >= MIN_SPAN_DEG) await cropNeedle((from + to) / 2, Math.min(span, 90));
      else if (store.tool === "mark") await placeMark(store, store.planes.of(store.selection.index).at(angleAt(event), Math.max(radiusAt(event), 1)));
    } catch (error) {
      store.tell("say", error.message);
    }
    draw();
  });

  // A needle cropped: the selected one, or a new one.
  async function cropNeedle(middle, span) {
    const { index, needle } = store.selection;
    const angle = await axisAt(store, middle);
    if (needle === undefined) addNeedle(store, index, { at: angle, span });
    else store.change("crop", (document) => Object.assign(document.gauges[index].needles[needle].template, { at: angle, span }));
  }

  new ResizeObserver(draw).observe(root);
  store.on("change select", follow);
  follow();
}
