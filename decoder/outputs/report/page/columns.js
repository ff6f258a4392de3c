// The flight as the page carries it: typed arrays, rows in the order of time.
const KINDS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array };

// Every machine that shows this page is little-endian, as the arrays are.
export function numbers(packed) {
  if (Uint8Array.fromBase64) return new KINDS[packed.kind](Uint8Array.fromBase64(packed.data).buffer);
  const text = atob(packed.data);
  const bytes = new Uint8Array(text.length);
  for (let at = 0; at < text.length; at++) bytes[at] = text.charCodeAt(at);
  return new KINDS[packed.kind](bytes.buffer);
}

export const content = (id) => JSON.parse(document.getElementById(id).textContent);

export function loadFlight() {
  const flight = content("flight");
  for (const name of ["time_ms", "frame"]) flight[name] = numbers(flight[name]);
  flight.film_s &&= numbers(flight.film_s);
  for (const needle of flight.needles) {
    for (const name of ["value", "sigma", "score", "status"]) needle[name] = numbers(needle[name]);
    for (const cause of needle.budget?.sigmas ?? []) cause[1] = numbers(cause[1]);
    needle.truth = needle.truth ? numbers(needle.truth) : null;
  }
  for (const check of flight.checks) for (const name of ["one", "other"]) check[name] = numbers(check[name]);
  for (const track of flight.alignment) track.values = numbers(track.values);
  return flight;
}

// The row nearest to a time, by halving; times rise.
export function nearestRow(times, time) {
  const after = Math.min(firstFrom(times, time), times.length - 1);
  return after > 0 && time - times[after - 1] <= times[after] - time ? after - 1 : after;
}

// The first row that is not before a time.
export function firstFrom(times, time) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}
