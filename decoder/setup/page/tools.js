// The tools: what each is for, how many clicks it takes, and what it makes of them. The same by pointer and by keys.
import { byId, h } from "./dom.js";
import { inSweep, rounded } from "./geometry.js";
import { addAnchor, addGauge, addMark, addNeedle, addReference, setLevel } from "./items.js";
import { ask, TAB } from "./server.js";

const needsGauge = (store) => (store.gauge ? "" : "Select or add a gauge first.");

export const TOOLS = {
  select: { key: "v", name: "Select", clicks: 0, hint: "" },
  anchor: {
    key: "a",
    name: "Anchor",
    clicks: 2,
    hint: "Box a feature that never changes and stands nowhere else: drag, or click two corners.",
    done: (store, [one, other]) => addAnchor(store, one, other),
  },
  level: {
    key: "l",
    name: "Level",
    clicks: 2,
    hint: "Click both ends of a long edge that is vertical on the panel.",
    done: (store, [one, other]) => setLevel(store, one, other),
  },
  reference: {
    key: "r",
    name: "Reference",
    clicks: 1,
    stays: true,
    hint: "Click a place whose position on the panel is known in inches, then type it.",
    done: async (store, [point]) => {
      addReference(store, point);
      store.tell("type", `reference_points[${store.selection.index}].inches[0]`);
    },
  },
  gauge: {
    key: "g",
    name: "Gauge",
    clicks: 3,
    hint: "Click three outer ends of tick marks, well apart; the circle finds the ring they stand on.",
    done: async (store, points) => {
      const rim = await ask("rim", { picture: store.now.picture, points });
      addGauge(store, rim);
      store.use("select");
      store.tell("type", `gauges[${store.selection.index}].name`);
    },
  },
  mark: {
    key: "t",
    name: "Tick marks",
    clicks: 1,
    stays: true,
    needs: needsGauge,
    hint: "Click on a tick mark, type its value, Enter; then the next.",
    done: (store, [point]) => placeMark(store, point),
  },
  needle: {
    key: "n",
    name: "Needle",
    clicks: 1,
    needs: needsGauge,
    hint: "Click on the needle.",
    done: (store, [point]) => placeNeedle(store, point),
  },
};

export async function placeMark(store, click) {
  const { index } = store.selection;
  const { angle } = await ask("mark", { picture: store.now.picture, centre: store.gauge.centre, click });
  const mark = addMark(store, index, angle);
  store.tell("type", `gauges[${index}].scale[${mark}][1]`);
}

export async function placeNeedle(store, click, span = 16) {
  const { index } = store.selection;
  const { centre, sweep } = store.gauge;
  const clicked = (Math.atan2(click[1] - centre[1], click[0] - centre[0]) * 180) / Math.PI;
  const found = await axisAt(store, inSweep(clicked, sweep));
  addNeedle(store, index, { at: found, span });
  store.use("select");
  store.tell("type", `gauges[${index}].needles[${store.selection.needle}].name`);
}

// The axis of the needle next to an angle.
export async function axisAt(store, near) {
  const { centre, radius, sweep } = store.gauge;
  const { document, picture } = store.now;
  const found = await ask("needles", { document, picture, centre, radius, sweep, near, tab: `${TAB}-near` });
  return found ? rounded(found.at, 4) : near;
}

export async function click(store, point) {
  const tool = TOOLS[store.tool];
  if (!tool.clicks || store.looking) return;
  const why = tool.needs?.(store);
  if (why) {
    store.tell("say", why);
    return;
  }
  store.clicks.push(point.map((value) => rounded(value, 2)));
  if (store.clicks.length < tool.clicks) {
    store.tell("tool");
    return;
  }
  const points = store.clicks;
  store.clicks = [];
  try {
    await tool.done(store, points);
    if (!tool.stays && TOOLS[store.tool] === tool) store.use("select");
    else store.tell("tool");
  } catch (error) {
    store.tell("say", error.message);
    store.tell("tool");
  }
}

export function showTools(store) {
  const bar = byId("tools");
  const buttons = Object.entries(TOOLS).map(([name, tool]) =>
    h(
      "button",
      { id: `tool-${name}`, title: `${tool.name} (${tool.key.toUpperCase()})`, "aria-keyshortcuts": tool.key.toUpperCase(), onclick: () => pick(store, name) },
      tool.name,
      h("kbd", { "aria-hidden": "true" }, tool.key.toUpperCase()),
    ),
  );
  bar.replaceChildren(...buttons);
  const show = () => {
    Object.keys(TOOLS).forEach((name, place) => buttons[place].setAttribute("aria-pressed", store.tool === name));
    byId("picture").classList.toggle("select", store.tool === "select");
    const { clicks, hint, needs } = TOOLS[store.tool];
    const left = store.clicks.length ? ` (${store.clicks.length} of ${clicks})` : "";
    byId("hint").textContent = needs?.(store) || hint + left;
  };
  store.on("tool select", show);
  show();
}

export function pick(store, name) {
  store.use(name);
  byId("picture").focus({ preventScroll: true });
}
