// The tools: what each is for, how many clicks it takes, and what it makes of them. The same by pointer and by keys.
import { byId, h } from "./dom.js";
import { gaugeAt, marksOf, outOn, replane } from "./dials.js";
import { valued } from "./following.js";
import { inSweep, nearest, RADIANS, rounded, suggested } from "./geometry.js";
import { addAnchor, addGauge, addMark, addNeedle, addReference, addWindow, setLevel } from "./items.js";
import { kindOf } from "./kinds.js";
import { needleQuestion } from "./offers.js";
import { Plane } from "./planes.js";
import { ask, TAB } from "./server.js";

const needsGauge = (store) => {
  if (!store.gauge) return "Select or add a gauge first.";
  return store.gauge.window ? "A window has no marks around it: select a dial." : "";
};

const ITS_SURROUNDINGS = 1.25; // of a dial's radius: what is clicked there may be meant for it
const SAME_MARK_DEG = 1e-3; // angles are rounded
const INWARDS_PX = 3; // from the outer end of a mark to where it is surely seen

let pointedAt = 0; // how many needles were pointed at

export const TOOLS = {
  select: { key: "v", name: "Select", clicks: 0, hint: "" },
  anchor: {
    key: "a",
    name: "Anchor",
    clicks: 2,
    hint: "Box a feature that never changes and appears nowhere else: drag, or click two corners.",
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
    hint: "Click three outer ends of tick marks, well apart; the rim finds the ring they stand on, round or oblique.",
    done: async (store, points) => {
      const { picture } = store.now;
      const rim = await ask("rim", { ...store.planes.seen, points });
      if (rim.doubt_px) {
        if (store.tool !== "gauge" || store.clicks.length || store.now.picture !== picture) return; // somebody went on
        store.clicks = points; // one more, on the hub
        store.tell("say", `From these three ends the centre may lie ${rim.doubt_px} pixels off: click the hub as well, where its needle turns.`);
        return;
      }
      addGauge(store, rim, await anglesOf(store, rim, points.slice(0, 3)));
      store.use("select");
      store.tell("type", `gauges[${store.selection.index}].name`);
    },
  },
  window: {
    key: "w",
    name: "Window",
    clicks: 4,
    hint: "Click the four corners of a lamp or a display, clockwise from its top left.",
    done: (store, corners) => {
      addWindow(store, corners);
      store.use("select");
      store.tell("type", `gauges[${store.selection.index}].name`);
    },
  },
  rim: {
    key: "e",
    name: "Ellipse",
    clicks: 1,
    stays: true,
    needs: needsGauge,
    hint: "Where the rim misses the marks: click their outer ends all round the dial; each click bends it there.",
    done: (store, [point]) => bendRim(store, point),
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
  place: {
    key: "p",
    name: "Places",
    clicks: 1,
    stays: true,
    needs: (store) => (store.gauge && clickable(store, store.gauge) ? "" : "Select a ball, a horizon, a straight scale or a tape first."),
    hint: "Click a mark of its scale, or a place of the ball's middle, then type its value, Enter; then the next.",
    done: (store, [point]) => placeValue(store, point),
  },
};

// What of a gauge's kind is a list of places with their values.
const clickable = (store, gauge) => kindOf(store, gauge).controls.find(({ reads, upright }) => upright || reads === "points" || reads === "places");

// How far above the centre a place lies along the upright of what turns with the scale.
function above(store, gauge, own, turnKey, point) {
  const [angle, radius] = store.planes.of(store.selection.index).polar(point);
  const index = typeof own.index === "number" ? own.index : 270;
  const [mark] = valued(gauge.scale);
  const level = mark ? mark[0] - (mark[1] * 360) / (gauge.wraps || 360) : index;
  const upright = index + (typeof own[turnKey] === "number" ? own[turnKey] : 1) * nearest(level - index, 0);
  return rounded(radius * Math.cos((angle - upright) * RADIANS), 2);
}

function placeValue(store, point) {
  const { gauge, selection } = store;
  const { key } = kindOf(store, gauge);
  const control = clickable(store, gauge);
  const at = point.map((value) => rounded(value, 1));
  const own = gauge[key];
  const place = control.upright ? [above(store, gauge, own, control.upright, point), null] : control.reads === "points" ? [...at, null] : [at, null];
  store.change("place", (document) => {
    const list = document.gauges[selection.index][key];
    list[control.key] = [...(Array.isArray(list[control.key]) ? list[control.key] : []), place];
  });
  store.tell("type", `gauges[${selection.index}].${key}.${control.key}`);
}

// The angles of the marks whose outer ends were clicked.
function anglesOf(store, { centre, rim, radius, matrix }, points) {
  const plane = new Plane(matrix);
  const angleOf = async (point) => {
    const click = plane.at(plane.angleOf(point), Math.max(radius - INWARDS_PX, radius / 2));
    return rounded((await ask("mark", { ...store.planes.seen, centre, rim: rim ?? undefined, click })).angle, 4);
  };
  return Promise.all(points.map(angleOf));
}

// A mark that was clicked and left with a value which an even scale gives is taken at that; the rim's clicks are not.
function takeGuess(store) {
  const { index, mark, needle } = store.selection;
  const own = store.gauge?.needles?.[needle]?.scale ? store.gauge.needles[needle] : store.gauge;
  if (mark === undefined || own.scale?.[mark]?.[1] !== null) return;
  const [angle] = own.scale[mark];
  if (Math.abs(nearest(angle, store.placedMark) - store.placedMark) > SAME_MARK_DEG) return;
  const guess = suggested(own.scale, mark, own.wraps);
  if (guess === undefined) return;
  store.change("guess", (document) => { marksOf(document.gauges[index], { needle })[mark][1] = guess; });
}

export async function placeMark(store, click) {
  takeGuess(store);
  const { index } = store.selection;
  const { centre, rim } = store.gauge;
  const { angle } = await ask("mark", { ...store.planes.seen, centre, rim, click });
  store.tell("type", addMark(store, index, angle));
}

// Bends the rim to where it was clicked: the more clicks, the more they decide.
export async function bendRim(store, point) {
  const { gauge } = store;
  const { index } = store.selection;
  const before = store.planes.of(index);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const radius = gauge.rim ? mean(gauge.rim.map((each) => before.polar(each)[1])) : gauge.radius[1];
  const points = [...store.bends, point];
  const found = await ask("rim", { ...store.planes.seen, points, ring: { centre: gauge.centre, radius, rim: gauge.rim } });
  store.bends = points;
  store.planes.keep(found, found.matrix);
  store.change("bend", (document) => {
    const own = document.gauges[index];
    replane(store, own, before, new Plane(found.matrix));
    own.radius = own.radius.map((each) => rounded((each * found.radius) / radius, 2));
    Object.assign(own, { centre: found.centre, rim: found.rim });
  });
}

// Back to how the dial is seen without a rim of its own.
export async function unbendRim(store, index) {
  const gauge = store.document.gauges[index];
  const before = store.planes.of(index);
  const after = await store.planes.fetch({ ...gauge, rim: undefined });
  store.change("unbend", (document) => {
    replane(store, document.gauges[index], before, after);
    delete document.gauges[index].rim;
  });
}

export async function placeNeedle(store, click) {
  const { index } = store.selection;
  const clicked = store.planes.of(index).angleOf(click);
  addNeedle(store, index, await needleAt(store, inSweep(clicked, store.gauge.sweep)));
  store.use("select");
  store.tell("type", `gauges[${index}].needles[${store.selection.needle}].name`);
}

// The needle next to an angle: its axis, and how much its template should span. Every needle that was pointed at is
// looked for, however soon the next one is.
async function needleAt(store, near, index = store.selection.index) {
  pointedAt += 1;
  const found = await ask("needles", { ...needleQuestion(store, index), near, tab: `${TAB}-near-${pointedAt}` });
  return { at: rounded(found.at, 4), span: found.span, reach: found.reach };
}

export const axisAt = async (store, near, index) => (await needleAt(store, near, index)).at;

// The axes of all needles of a gauge found again; what is changed meanwhile stays as it is.
export async function findAxes(store, index) {
  const found = new Map();
  for (const { template } of store.document.gauges[index].needles || []) {
    if (typeof template?.at === "number") found.set(template.at, await axisAt(store, template.at, index));
  }
  store.change("axes", (document) => {
    document.gauges[index]?.needles?.forEach(({ template }) => {
      if (found.has(template?.at)) template.at = found.get(template.at);
    });
  });
}

// Another gauge that a click lies within, where the tool draws on the selected one and has not begun with it.
function clickedOther(store, { needs }, point) {
  if (!needs || store.clicks.length || store.bends.length) return undefined;
  const own = store.selection.index;
  // Marks of a window's scale may well stand outside of it.
  const mayBeMeant = !needs(store) && (store.gauge.window || outOn(store, own, point) < ITS_SURROUNDINGS);
  const index = mayBeMeant ? undefined : gaugeAt(store, point);
  return store.gauge && index === own ? undefined : index;
}

export async function click(store, point) {
  const tool = TOOLS[store.tool];
  if (!tool.clicks || store.looking) return;
  const other = clickedOther(store, tool, point);
  if (other !== undefined) {
    if (store.tool === "mark" && store.gauge) takeGuess(store);
    store.select({ kind: "gauge", index: other });
    return;
  }
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
    if (store.clicks.length) store.tell("tool"); // they do not tell enough
    else if (!tool.stays && TOOLS[store.tool] === tool) store.use("select");
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
    const left = !store.clicks.length ? "" : store.clicks.length < clicks ? ` (${store.clicks.length} of ${clicks})` : " Now click the hub.";
    byId("hint").textContent = needs?.(store) || hint + left || (store.tool === "select" && store.hint) || "";
  };
  store.on("tool select hint", show);
  show();
}

export function pick(store, name) {
  store.use(name);
  byId("picture").focus({ preventScroll: true });
}
