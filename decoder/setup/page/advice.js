// How a gauge might be drawn better: asked for once it was tried, and offered only where all frames then fit better.
import { h } from "./dom.js";
import { isGiven, written } from "./following.js";
import { areNumbers, RADIANS } from "./geometry.js";
import { ask, TAB } from "./server.js";

const IDS = { centre: "usepivot", height: "useheight", around: "findaxes", axes: "useaxis" };
const AGAIN_MS = 400;
const WELL_PX = 0.03; // along its circle: an axis that lies nearer is drawn well

const isDrawnWell = ({ moved, axes = {} }, { radius }) => !moved && Object.values(axes).every((off) => Math.abs(off) * RADIANS * radius[1] < WELL_PX);

// What is offered on a gauge, by the result of its trial; null while that is worked out.
function offersOn(store, result, index) {
  if (result.offers === undefined) look(store, result, index);
  return result.offers;
}

async function look(store, result, index) {
  result.offers = isDrawnWell(result, store.document.gauges[index]) ? [] : null;
  if (result.offers) return;
  const { document, picture } = store.now;
  try {
    const answer = await ask("advice", { document: written(document), picture, gauge: index, tab: TAB });
    result.offers = answer?.offers;
  } catch {
    result.offers = [];
  }
  if (result.offers) store.tell("trial");
  else setTimeout(() => store.tell("trial"), AGAIN_MS); // somebody drew meanwhile, or looked at another gauge
}

// Marks as they are offered, and those that nobody gave a value: where the others moved, they move along.
function withOpen(offered, drawn, carry) {
  if (!offered) return {};
  const isMoved = JSON.stringify(offered) !== JSON.stringify((drawn || []).filter(isGiven));
  const open = (drawn || []).filter((mark) => !isGiven(mark)).map(([angle, value]) => [isMoved && areNumbers(angle) ? carry(angle) : angle, value]);
  return { scale: [...offered, ...open].sort(([one], [other]) => one - other) };
}

// A gauge as it is offered. Its sweep is the one that it was tried with, unless marks still wait for their values.
function take(store, index, gauge) {
  const plane = store.planes.of(index);
  const carry = (angle) => plane.carry(angle, gauge.radius[1], plane.movedTo(gauge.centre));
  store.change("advice", (document) => {
    const drawn = document.gauges[index];
    const needles = gauge.needles?.map((each, place) => ({ ...each, ...withOpen(each.scale, drawn.needles?.[place]?.scale, carry) }));
    document.gauges[index] = { ...gauge, ...withOpen(gauge.scale, drawn.scale, carry), ...(needles && { needles }) };
  });
  if (!gauge.sweep || !store.document.gauges[index].scale?.every(isGiven)) return;
  store.change("advice", (document) => { document.gauges[index].sweep = [...gauge.sweep]; }); // the same step back
}

// The cards of a gauge's offers, and of what none of them mends; all that the decoder would say of it where there are none.
export function advicePart(store, live, index) {
  const result = live.resultOf(index);
  if (!result || result.error) return null;
  const offers = offersOn(store, result, index);
  const { findings = [], mistakes = [] } = result;
  const said = offers?.length ? mistakes : findings;
  const health = said.length ? h("div", { class: "card offer small", id: "health" }, ...said.map((each) => h("p", {}, `The gauge ${each}.`))) : null;
  if (!offers) return h("p", { class: "quiet small", id: "advising" }, "Checking whether all frames would read better with a correction …");
  if (!offers.length) return health;
  const cards = offers.map(({ key, said: reason, does, gain, gauge }) =>
    h(
      "div",
      { class: "card offer small" },
      h("p", {}, `${reason}.`),
      h("p", { class: "quiet gain" }, `With it, over all frames: ${gain}.`),
      h("button", { id: IDS[key], onclick: () => take(store, index, gauge) }, does),
    ),
  );
  return health ? [health, ...cards] : cards;
}
