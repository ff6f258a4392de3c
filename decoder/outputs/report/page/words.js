// Numbers and times as people read them.
export const CONFIDENCE_SIGMAS = 1.96;
const MOST_DECIMALS = 100; // that toFixed takes

export const spreadOf = (needle, row) => CONFIDENCE_SIGMAS * needle.sigma[row];

export function valueText(needle, row) {
  const value = needle.value[row];
  if (!Number.isFinite(value)) return "missing";
  return `${needle.written ? writtenText(needle, value) : value.toFixed(needle.decimals)} ${needle.unit}`.trim();
}

// A state, a text or a display's number, as flight.csv has it.
export function writtenText({ written, decimals }, value) {
  if (written.type === "boolean") return value ? "true" : "false";
  if (written.type === "number") return value.toFixed(decimals);
  const digits = [...String(value).padStart([...written.pattern].filter((sign) => sign === "0").length, "0")];
  return [...written.pattern].map((sign) => (sign === "0" ? digits.shift() : sign)).join("");
}

export const isMeasured = (needle) => !needle.written || needle.written.type === "number";

// With at least one digit that is not 0, since no value is certain.
export function spreadText(needle, row) {
  const spread = spreadOf(needle, row);
  if (!isMeasured(needle) || !Number.isFinite(spread)) return "";
  const needed = spread > 0 ? -Math.floor(Math.log10(spread)) : 0;
  return `± ${spread.toFixed(Math.min(Math.max(needle.decimals, needed), MOST_DECIMALS))}`;
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
