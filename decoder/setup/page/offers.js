// Needles that are proposed: what moves on a dial, looked for once for each way it is drawn.
import { ask, TAB } from "./server.js";

const FULL = 360;

// What the program must know of a gauge to look for its needles.
export function needleQuestion(store, index) {
  const { centre, radius, sweep, rim, needle_height_inches } = store.document.gauges[index];
  return { ...store.now, size: undefined, centre, radius, sweep, rim, needle_height_inches };
}

// What proposals depend on: not on the sweep, which is hardly drawn by then, nor on how far inwards the needles are looked at.
function keyOf(store, index) {
  const { centre, radius, rim } = store.document.gauges[index];
  return JSON.stringify([store.planes.seen, centre, radius[1], rim]);
}

// What is offered on a gauge; null while it is looked for, undefined before.
export const offersOn = (store, index) => store.offers.get(keyOf(store, index));

export async function lookForNeedles(store, index) {
  const key = keyOf(store, index);
  if (store.offers.has(key)) return;
  store.offers.set(key, null);
  const question = needleQuestion(store, index);
  const middle = (question.sweep[0] + question.sweep[1]) / 2;
  try {
    const found = await ask("needles", { ...question, sweep: [middle - FULL / 2, middle + FULL / 2], tab: `${TAB}-${index}` });
    if (found) store.offers.set(key, found.needles);
    else store.offers.delete(key);
  } catch {
    store.offers.delete(key);
    return;
  }
  store.tell("trial");
}
