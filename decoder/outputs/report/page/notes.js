// Notes and a sign-off: written here, saved as a file beside the page, and opened only where the data are the same.
import { byId, h } from "./dom.js";
import { give } from "./download.js";
import { frameText, utcText } from "./words.js";

export function useNotes(state) {
  const { flight } = state;
  const { about } = flight;
  const key = `notes ${about.data_sha256}`;
  let kept = recalled(key) || { notes: [], sign_off: null };
  byId("notes-hash").textContent = about.data_sha256;

  function say(words) {
    byId("notes-say").textContent = words;
    byId("notes-say").hidden = !words;
  }

  function show() {
    byId("notes-list").replaceChildren(...kept.notes.map((note, at) => {
      const row = flight.frame.indexOf(note.frame);
      return h("li", {},
        h("button", { onclick: () => row >= 0 && state.choose(row) }, frameText(flight, row)), ` ${note.text} `,
        h("span", { class: "quiet" }, `${note.name}, ${note.written_utc} `),
        h("button", { "aria-label": `Remove note ${at + 1}`, onclick: () => change({ notes: kept.notes.filter((other) => other !== note) }) }, "Remove"));
    }));
    const { sign_off } = kept;
    byId("signed").textContent = sign_off ? `Signed off by ${sign_off.name}, ${sign_off.signed_utc}: ${sign_off.text}` : "Not signed off.";
  }

  // What is changed after a sign-off is signed by nobody.
  function change(part) {
    if (kept.sign_off && !part.sign_off) say("The sign-off is withdrawn: the notes have changed since.");
    else say("");
    kept = { ...kept, sign_off: null, ...part };
    try {
      localStorage.setItem(key, JSON.stringify(kept));
    } catch {
      // nothing is kept in the browser then; the file is what counts
    }
    show();
  }

  const now = () => `${new Date().toISOString().slice(0, 19)}Z`;
  byId("note-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const row = state.row;
    if (row < 0) return;
    const note = { frame: flight.frame[row], time_utc: flight.start_utc ? utcText(flight, row) : null, name: byId("note-name").value.trim(), text: byId("note-text").value.trim(), written_utc: now() };
    change({ notes: [...kept.notes, note] });
    byId("note-text").value = "";
  });
  byId("sign-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const name = byId("note-name").value.trim();
    if (!name) return say("A sign-off needs a name: write it above.");
    change({ sign_off: { name, text: byId("sign-text").value.trim(), signed_utc: now(), data_sha256: about.data_sha256, notes: kept.notes.length } });
  });
  byId("notes-save").addEventListener("click", () => give(`${about.name}.notes.json`, `${JSON.stringify({ about, ...kept }, null, 2)}\n`, "application/json"));
  byId("notes-file").addEventListener("change", async (event) => {
    const [file] = event.target.files;
    event.target.value = "";
    if (!file) return;
    const found = understood(await file.text());
    if (!found) say(`${file.name} holds no notes of a report.`);
    else if (found.about.data_sha256 !== about.data_sha256) say(`${file.name} is about other data (SHA-256 ${String(found.about.data_sha256).slice(0, 16)}...), and was not opened.`);
    else {
      const known = new Set(kept.notes.map((note) => JSON.stringify(note)));
      change({ notes: [...kept.notes, ...found.notes.filter((note) => !known.has(JSON.stringify(note)))], sign_off: found.sign_off });
      say(`${found.notes.length} notes opened from ${file.name}.`);
    }
  });
  show();
}

function understood(text) {
  try {
    const found = JSON.parse(text);
    const isText = (value) => typeof value === "string";
    const areNotes = Array.isArray(found.notes) && found.notes.every((note) => Number.isFinite(note.frame) && isText(note.text) && isText(note.name) && isText(note.written_utc));
    const isSigned = found.sign_off === null || (isText(found.sign_off.name) && isText(found.sign_off.text) && isText(found.sign_off.signed_utc));
    return areNotes && isSigned && found.about ? found : null;
  } catch {
    return null;
  }
}

function recalled(key) {
  try {
    return understood(JSON.stringify({ about: {}, ...JSON.parse(localStorage.getItem(key)) }));
  } catch {
    return null;
  }
}
