// What is plotted over time: a needle with its band, or how far it is from the truth.
import { CONFIDENCE_SIGMAS } from "./words.js";

const LEAST_PART = 0.004; // of full scale: a needle that stands still is not blown up to its noise

export function needleTrack(flight, at) {
  const needle = flight.needles[at];
  const { value, sigma, status, truth, wraps } = needle;
  return {
    at,
    values: value,
    low: value.map((each, row) => each - CONFIDENCE_SIGMAS * sigma[row]),
    high: value.map((each, row) => each + CONFIDENCE_SIGMAS * sigma[row]),
    status,
    truth,
    wraps,
    least: needle.full_scale * LEAST_PART,
    rings: flight.flags.filter(([, , kind, own]) => kind === "outlier" && own === at).flatMap(([first, last]) => range(first, last)),
  };
}

// The error lies within the band in 95 % of all frames, if the uncertainty is right.
export function errorTrack(flight, at) {
  const needle = flight.needles[at];
  const { value, sigma, truth, wraps, status } = needle;
  const short = (error) => (wraps ? error - wraps * Math.round(error / wraps) : error);
  return {
    at,
    values: value.map((each, row) => short(each - truth[row])),
    low: sigma.map((each) => -CONFIDENCE_SIGMAS * each),
    high: sigma.map((each) => CONFIDENCE_SIGMAS * each),
    status,
    least: needle.full_scale * 1e-5,
  };
}

// Two ways to the same thing; where they disagree is shaded.
export function checkTrack(flight, at) {
  const { one, other, unit, apart } = flight.checks[at];
  const isHeading = unit === "deg";
  return { at: -1, values: one, truth: other, wraps: isHeading ? 360 : null, shaded: apart };
}

const range = (first, last) => Array.from({ length: last - first + 1 }, (_, at) => first + at);
