// Saving, what keeps the draft from being saved, and what to do if somebody else has saved it meanwhile.
import { byId, h } from "./dom.js";
import { asDrawn, written } from "./following.js";
import { selectionOf } from "./outline.js";
import { ask, onLost } from "./server.js";

export function showSaving(store) {
  const state = byId("state");
  const banner = byId("banner");
  let said = 0;

  function show() {
    const count = store.problems.length;
    const open = count ? `${count} thing${count > 1 ? "s" : ""} to correct` : "";
    const saved = store.isSaved ? (store.revision ? "saved" : "not changed") : "not saved";
    state.textContent = [open, saved].filter(Boolean).join(" · ");
    state.classList.toggle("unsaved", !store.isSaved);
    byId("undo").disabled = !store.past.length;
    byId("redo").disabled = !store.future.length;
    byId("title").textContent = store.document.name || "Panel set-up";
    document.title = `${store.isSaved ? "" : "• "}${store.document.name || "Panel"} – set-up`;
  }

  function say(words, ...buttons) {
    banner.replaceChildren(h("span", {}, words), ...buttons, h("button", { class: "remove", "aria-label": "Close", onclick: () => { banner.hidden = true; } }, "×"));
    banner.hidden = false;
    clearTimeout(said);
    if (!buttons.length) said = setTimeout(() => { banner.hidden = true; }, 9000);
  }

  function lead() {
    const [{ path }] = store.problems;
    const count = store.problems.length;
    store.select(selectionOf(path));
    store.tell("problems");
    banner.classList.remove("good");
    say(`Not saved: ${count} thing${count > 1 ? "s" : ""} to correct first.`);
  }

  // `asked` is what somebody was asked before: whether to save over what others saved, or over files of another panel.
  async function save(asked = {}) {
    const now = JSON.stringify(store.now);
    const { document: drawn, picture } = store.now;
    const asWas = JSON.stringify([drawn, picture]);
    const body = { document: written(drawn), picture, revision: store.revision, ...asked };
    try {
      const { revision, target } = await ask("panel", body, { method: "PUT" });
      store.revision = revision;
      store.saved = now;
      store.tell("saved");
      store.judge(asWas, []);
      show();
      say(`Saved to ${target}.`);
      banner.classList.add("good");
    } catch (error) {
      banner.classList.remove("good");
      if (error.why === "elsewhere") say(error.message, h("button", { id: "loadtheirs", onclick: load }, "Load that one"), h("button", { id: "saveover", onclick: () => save({ ...asked, over: true }) }, "Save this one over it"));
      else if (error.why === "replace") say(error.message, h("button", { id: "replace", onclick: () => save({ ...asked, replace: true }) }, "Save over what is there"));
      else if (error.problems?.length) {
        if (store.judge(asWas, error.problems.map(({ path, problem }) => ({ path: asDrawn(drawn, path), problem })))) lead();
        else say("Not saved: the drawing had errors to correct first.");
      } else say(error.message);
    }
  }

  async function load() {
    store.replace(await ask("session"));
    banner.hidden = true;
  }

  onLost((lost) => {
    banner.classList.remove("good");
    if (lost) say("The program has ended. What you drew is kept: start decode setup again, and the page continues from here.", h("span"));
    else banner.hidden = true;
    byId("save").disabled = lost;
  });
  store.on("say", ({ detail }) => {
    banner.classList.remove("good");
    say(detail);
  });
  store.on("change problems select", show);
  addEventListener("beforeunload", (event) => {
    if (!store.isSaved) event.preventDefault();
  });
  byId("save").addEventListener("click", () => save());
  show();
  return { save: () => save() };
}
