// The program behind the page: asking it things, and noticing when it has ended.
const BASE = new URL("api/", location.href.replace(/[^/]*$/, ""));
const PING_MS = 2500;
export const TAB = crypto.randomUUID();

// What was asked for cannot be, and why: `why` is "elsewhere", "invalid" or "cannot".
export class Declined extends Error {
  constructor({ error, declined, problems }) {
    super(error);
    this.why = declined;
    this.problems = problems || [];
  }
}

export class Lost extends Error {}

const listeners = new Set();
let lost = false;

export const onLost = (listener) => listeners.add(listener);

function told(now) {
  if (now !== lost) {
    lost = now;
    listeners.forEach((listener) => listener(lost));
  }
}

// The answer to a question; null if a later question has made it pointless.
export async function ask(path, body, { method = body === undefined ? "GET" : "POST", signal } = {}) {
  const options = { method, signal };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { "Content-Type": "application/json" };
  }
  let response;
  try {
    response = await fetch(new URL(path, BASE), options);
  } catch (error) {
    if (error.name === "AbortError") return null;
    told(true);
    throw new Lost("the program has ended");
  }
  told(false);
  if (response.status === 204) return null;
  const answer = await response.json().catch(() => ({ declined: "cannot", error: `the program's answer was not understood (${response.status})` }));
  if (!response.ok || answer.declined) throw new Declined(answer);
  return answer;
}

export const pictureAddress = (key, part) => new URL(`pictures/${key}/${part}`, BASE).href;

export function watch() {
  setInterval(() => ask("ping").catch(() => {}), PING_MS);
}
