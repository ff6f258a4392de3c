// The frame slider: look at other frames, and draw on another one; what is drawn is carried over to it.
import { byId, h } from "./dom.js";
import { ask } from "./server.js";

export function showFrames(store, live, view) {
  const root = byId("frames");
  const { frames } = store.session;
  const slider = h("input", { type: "range", id: "frame", min: 0, max: Math.max(frames - 1, 0), step: 1, value: drawnOn() ?? 0 });
  const name = h("output", { for: "frame" });
  const use = h("button", { id: "useframe", onclick: carry }, "Draw on this frame");
  const back = h("button", { id: "lookback", onclick: () => look(null) }, "Back to the drawing");
  const note = h("p", { class: "note" });
  root.append(h("label", { for: "frame" }, "Frame"), slider, name, use, back, note);
  let timer = 0;

  function drawnOn() {
    const match = /^frame-(\d+)$/.exec(store.now.picture);
    return match ? Number(match[1]) : null;
  }

  async function look(frame) {
    const key = frame === null || frame === drawnOn() ? null : `frame-${frame}`;
    store.looking = key;
    store.tell("looking");
    clearTimeout(timer);
    timer = setTimeout(async () => {
      try {
        const { size } = key ? await ask(`pictures/${key}/size`) : store.now;
        if (store.looking === key) view.show(size, key || store.now.picture);
      } catch (error) {
        store.tell("say", error.message);
      }
    }, 40);
  }

  async function carry() {
    const to = store.looking;
    const { document, picture } = store.now;
    try {
      const done = await ask("paste", { document, picture, to });
      store.change("carry over", () => done.document, { picture: done.picture, size: done.size });
      const { offset, roll, score } = done.moved || {};
      store.tell("say", done.moved ? `Carried over: moved by ${offset[0]}, ${offset[1]} px, turned by ${roll}°, found with a score of ${score}.` : "The picture is exchanged.");
    } catch (error) {
      store.tell("say", `The panel was not found in that frame: ${error.message}`);
      return;
    }
    await look(null);
  }

  function show() {
    const drawn = drawnOn();
    const looked = store.looking ? Number(store.looking.slice(6)) : drawn;
    if (looked !== null) slider.value = looked;
    name.textContent = looked === null ? "panel picture" : `${looked} of ${frames - 1}`;
    slider.setAttribute("aria-valuetext", name.textContent);
    use.hidden = back.hidden = !store.looking;
    const { kind, index } = store.selection;
    const offset = kind === "gauge" ? live.resultOf(index)?.offset : null;
    const far = offset && `This gauge lies ${offset.shift[0]}, ${offset.shift[1]} px from the panel picture in the flight, turned by ${offset.roll}° (median of ${offset.found} frames).`;
    note.textContent = store.looking ? "Only looking: the drawing belongs to another picture." : far || (drawn === null ? "The drawing is on the panel's own picture." : "");
    note.title = note.textContent;
  }

  let picture = store.now.picture;
  store.on("change", () => {
    if (store.now.picture !== picture) {
      picture = store.now.picture;
      view.show(store.now.size, picture);
    }
  });
  slider.addEventListener("input", () => look(Number(slider.value)));
  store.on("change select trial looking", show);
  show();
  return { step: (by) => look(Math.min(Math.max((store.looking ? Number(store.looking.slice(6)) : (drawnOn() ?? -by)) + by, 0), frames - 1)) };
}
