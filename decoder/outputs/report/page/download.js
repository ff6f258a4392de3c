// Files that the page gives out: the rows in view as a table, and notes.
import { firstFrom } from "./columns.js";
import { isMeasured, writtenText } from "./words.js";

export function give(name, text, type) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

const field = (text) => (/[,"]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

// The columns of flight.csv, as far as the page has them: what is measured in single precision, so seven digits.
export function tableOf(flight, from, to) {
  const needles = flight.needles;
  const lines = [["frame", "time_utc", "time_s", ...needles.flatMap(({ name }) => ["", "_status", "_score", "_sigma"].map((end) => name + end))]];
  const number = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(7))) : "");
  const shown = (needle, value) => (needle.written && Number.isFinite(value) ? field(writtenText(needle, value)) : number(value));
  for (let row = firstFrom(flight.time_ms, from); row < flight.rows && flight.time_ms[row] <= to; row++) {
    const time = flight.time_ms[row];
    const utc = flight.start_utc ? new Date(flight.start_ms + time).toISOString() : "";
    const seconds = ((time - flight.since_first_ms) / 1000).toFixed(6);
    lines.push([flight.frame[row], utc, seconds, ...needles.flatMap((needle) => [shown(needle, needle.value[row]), flight.statuses[needle.status[row]], number(needle.score[row]), isMeasured(needle) ? number(needle.sigma[row]) : ""])]);
  }
  return lines.map((line) => line.join(",")).join("\n") + "\n";
}

export function useDownload(state) {
  document.getElementById("download").addEventListener("click", () => give(`${state.flight.about.name}_part.csv`, tableOf(state.flight, ...state.view), "text/csv"));
}
