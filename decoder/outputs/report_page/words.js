// Numbers and times as people read them.
export const CONFIDENCE_SIGMAS = 1.96;

export const spreadOf = (needle, row) => CONFIDENCE_SIGMAS * needle.sigma[row];

export function valueText(needle, row) {
  const value = needle.value[row];
  return Number.isFinite(value) ? `${value.toFixed(needle.decimals)} ${needle.unit}`.trim() : "missing";
}

export function spreadText(needle, row) {
  const spread = spreadOf(needle, row);
  return Number.isFinite(spread) ? `± ${spread.toFixed(needle.decimals)}` : "";
}

export function utcText(flight, row) {
  if (!flight.start_utc) return "time of day unknown";
  const text = new Date(flight.start_ms + flight.time_ms[row]).toISOString();
  return `${text.slice(0, 10)} ${text.slice(11, 23)} UTC`;
}

export const secondsText = (flight, row) => `${((flight.time_ms[row] - flight.since_first_ms) / 1000).toFixed(3)} s`;
export const frameText = (flight, row) => `frame ${flight.frame[row]}`;

export function durationText(milliseconds) {
  const seconds = Math.abs(milliseconds) / 1000;
  if (seconds < 100) return `${seconds.toFixed(seconds < 10 ? 2 : 1)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}
