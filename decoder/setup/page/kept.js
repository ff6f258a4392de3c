// What somebody prefers of the page itself, kept in the browser from one flight to the next. In a cookie: each run of
// the program has a port of its own, and other stores of a browser are empty at another port.
const NAME = "decode_setup";
const YEAR_S = 365 * 24 * 3600;

function read() {
  const found = document.cookie.split("; ").find((each) => each.startsWith(`${NAME}=`));
  try {
    return JSON.parse(decodeURIComponent(found.slice(NAME.length + 1))) || {};
  } catch {
    return {};
  }
}

export const kept = (key) => read()[key];

export function keep(key, value) {
  const all = { ...read(), [key]: value };
  document.cookie = `${NAME}=${encodeURIComponent(JSON.stringify(all))}; path=/; max-age=${YEAR_S}; samesite=strict`;
}
