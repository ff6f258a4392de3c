// What a value's uncertainty is made of: what panel and flight leave in doubt, and what its own frame does.

// [words, standard uncertainty, part of the square] of each cause, the largest first; none where that is not known.
export function shares(flight, needle, row) {
  const sigma = needle.sigma[row];
  if (!needle.budget || !Number.isFinite(needle.value[row]) || !Number.isFinite(sigma)) return [];
  const { values, turn, sigmas } = needle.budget;
  const beyond = needle.value[row] - values[0];
  const value = values[0] + (turn === null ? beyond : beyond - turn * Math.floor(beyond / turn));
  const parts = sigmas.map(([words, own]) => [words, between(values, own, value)]);
  const known = parts.reduce((sum, [, part]) => sum + part ** 2, 0);
  const status = flight.statuses[needle.status[row]];
  parts.push([flight.frame_causes[status] ?? flight.frame_causes.read, Math.sqrt(Math.max(sigma ** 2 - known, 0))]);
  const whole = parts.reduce((sum, [, part]) => sum + part ** 2, 0);
  const told = parts.filter(([, part]) => part > 0).map(([words, part]) => [words, part, part ** 2 / whole]);
  return told.sort(([, one], [, other]) => other - one);
}

export const percentText = (part) => `${Math.round(100 * part) || "<1"} %`;

// A quantity at a value, from what it is at some that rise; beyond the ends as there.
function between(values, own, value) {
  const after = values.findIndex((each) => each >= value);
  if (after <= 0) return own[after < 0 ? own.length - 1 : 0];
  const part = (value - values[after - 1]) / (values[after] - values[after - 1]);
  return own[after - 1] + part * (own[after] - own[after - 1]);
}
