// The kinds of instrument there are, as the program describes them: it tells what people can draw of each.
export const kindOf = (store, gauge) => store.session.kinds.find(({ key }) => gauge[key]) || store.session.kinds[0];

// Whether anything of its kind is drawn on a gauge.
export const isDrawn = (store, gauge) => [gauge[kindOf(store, gauge).key] ?? []].flat().length > 0;

// Whether it is read by tick marks around a dial; a window and places along a line tell all by themselves.
export const needsMarks = (store, gauge) => !gauge.window && !kindOf(store, gauge).controls.some(({ reads }) => reads === "points");

// What a gauge begins with as one of a kind; `name` is its column's, if it has one alone.
const begun = (kind, name) => {
  if (!kind.begun) return [];
  return kind.controls.some(({ key }) => key === "name") ? { name, ...kind.begun } : { ...kind.begun };
};

// A gauge made one of another kind: what only the others have goes.
export function becomes(store, gauge, key, name) {
  for (const kind of store.session.kinds) for (const each of [kind.key, ...kind.along]) delete gauge[each];
  gauge[key] = begun(store.session.kinds.find((kind) => kind.key === key), name);
}

// The angles on the dial that people typed for a gauge's kind, changed one by one.
export function changeAngles(store, gauge, change) {
  const { key, controls } = kindOf(store, gauge);
  for (const { key: part, is_angle: isAngle } of controls) {
    if (isAngle && typeof gauge[key][part] === "number") gauge[key][part] = change(gauge[key][part]);
  }
}
