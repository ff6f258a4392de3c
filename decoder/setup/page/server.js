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

// What the program answers to a request; null if it was called off meanwhile.
async function reached(path, options) {
  try {
    const response = await fetch(new URL(path, BASE), options);
    told(false);
    return response;
  } catch (error) {
    if (error.name === "AbortError") return null;
    told(true);
    throw new Lost("the program has ended");
  }
}

// The answer to a question; null if a later question has made it pointless.
export async function ask(path, body, { method = body === undefined ? "GET" : "POST", signal } = {}) {
  const options = { method, signal };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { "Content-Type": "application/json" };
  }
  const response = await reached(path, options);
  if (!response) return null;
  if (response.status === 204) return null;
  const answer = await response.json().catch(() => ({ declined: "cannot", error: `the program's answer was not understood (${response.status})` }));
  if (!response.ok || answer.declined) throw new Declined(answer);
  return answer;
}

// The answers to a question that takes long, as they come.
export async function* askAlong(path, body, signal) {
  const options = { method: "POST", signal, body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  const response = await reached(path, options);
  if (!response) return;
  if (!response.ok) throw new Declined(await response.json());
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  const cut = () => ({ value: `${JSON.stringify({ error: "the answer ended before its time; the terminal where the program was started may say why" })}\n` });
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read().catch(cut);
    if (done) return;
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) yield JSON.parse(line);
  }
}

export const pictureAddress = (key, part) => new URL(`pictures/${key}/${part}`, BASE).href;

export function watch() {
  setInterval(() => ask("ping").catch(() => {}), PING_MS);
}
