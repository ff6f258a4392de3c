// Puts the page together.
import { byId } from "./dom.js";
import { showFilm } from "./film.js";
import { showFound } from "./found.js";
import { showFrames } from "./frames.js";
import { showInspector } from "./inspector.js";
import { closeUp, followKeys, showKeys } from "./keys.js";
import { showLight } from "./light.js";
import { Live } from "./live.js";
import { showLoupe } from "./loupe.js";
import { showOutline } from "./outline.js";
import { Overlay } from "./overlay.js";
import { Planes } from "./planes.js";
import { followPointer } from "./pointer.js";
import { FOLDING, Room } from "./room.js";
import { showSaving } from "./saving.js";
import { ask, watch } from "./server.js";
import { Store } from "./store.js";
import { showTools } from "./tools.js";
import { showUnwrapped } from "./unwrapped.js";
import { followWanted } from "./usual.js";
import { View } from "./view.js";

const session = await ask("session");
const store = new Store(session);
const view = new View(byId("picture"), store.now.size, store.now.picture);
store.planes = new Planes(store);
showUnwrapped(store); // first of all that follows a change: its question is on its way while the others draw
const overlay = new Overlay(store, view);
const live = new Live(store);
const close = () => closeUp(store, view);

byId("subtitle").textContent = `${session.name}, ${session.frames} ${session.frames === 1 ? "picture" : "frames"} · saves to ${session.target}`;
const { save } = showSaving(store);
const { step } = showFrames(store, live, view);
showTools(store);
showOutline(store, live, (selection) => {
  store.select(selection);
  close();
});
showInspector(store, live, close);
showFound(store, view);
showFilm(store, live);
followWanted(store);
followPointer(store, view, overlay);
const room = new Room(store);
const light = showLight();
const loupe = showLoupe(store, view);
const folds = Object.entries(FOLDING).map(([key, part]) => [key, () => room.fold(part)]);
followKeys(store, view, { save, step, b: light, m: loupe, ...Object.fromEntries(folds) });
byId("undo").addEventListener("click", () => store.undo());
byId("redo").addEventListener("click", () => store.redo());
byId("help").addEventListener("click", showKeys);
byId("zoomin").addEventListener("click", () => view.zoom(1.4));
byId("zoomout").addEventListener("click", () => view.zoom(1 / 1.4));
byId("fit").addEventListener("click", () => view.fit());
watch();
if (session.draft) {
  const { document: drawn, picture, size } = session.draft;
  store.change("go on", () => drawn, { picture, size });
  store.tell("say", "Continuing with earlier work that was not saved. Undo goes back to what is saved.");
}
document.body.dataset.ready = "true";
