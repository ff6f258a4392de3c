// Finding dials: its button, what is looked at meanwhile, and the list of what was found, to be accepted or dismissed.
import { byId, h } from "./dom.js";
import { evidenceOf, FoundLayer, lackingOf, upper } from "./found_layer.js";
import { Search } from "./search.js";

export function showFound(store, view) {
  const search = new Search(store);
  const layer = new FoundLayer(store, view, search);
  const root = h("section", { id: "found", "aria-label": "What was found" });
  byId("outline").prepend(root);
  const rows = new Map(); // by what is offered: a row is made once, so that it keeps the focus

  const tool = h("button", { id: "find", title: "Find dials (D)", "aria-keyshortcuts": "D", onclick: run }, h("span", {}, "Find dials"), h("kbd", { "aria-hidden": "true" }, "D"));
  byId("tools").append(tool);
  const begin = h("button", { id: "findhere", class: "main", onclick: run }, "Find dials");
  const intro = h("p", { class: "empty" }, "The page looks for dials, reads their numerals and proposes them, for you to accept one by one.");
  const status = h("p", { id: "looking", role: "status" });
  const all = h("button", { id: "acceptall", class: "main", onclick: () => search.acceptAll() });
  const list = h("ul");
  const notes = h("div", { class: "notes" });
  const back = h("button", { class: "link", id: "undismiss", onclick: () => search.restore() });
  const again = h("button", { class: "link", id: "findagain", onclick: run }, "Find again");
  root.append(h("div", { class: "part" }, h("h3", {}, "Found"), again), begin, intro, status, all, list, notes, back);
  root.addEventListener("keydown", (event) => {
    if (event.key !== "Delete" && event.key !== "Backspace") return;
    event.stopPropagation(); // what is selected is not meant, wherever in here the focus is
    const offer = event.target.closest("li")?.offer;
    if (offer) search.dismiss(offer);
  });

  function run() {
    if (search.isRunning) search.stop();
    else search.start();
  }

  // The key: looks for dials, or goes on with what was found.
  function find() {
    const first = list.querySelector(".accept");
    if (!first || search.isRunning) run();
    else {
      store.tell("list"); // where the outline is folded nothing in it can have the focus
      first.focus();
    }
  }

  function row(offer) {
    const isAnchors = offer === search.anchors;
    const name = isAnchors ? `${offer.anchors.length} anchors` : offer.name;
    const [read, asked] = offer.read || [];
    const isGood = isAnchors || (offer.is_whole && !offer.lacking.length && read === asked);
    const how = isAnchors ? "why" : offer.is_whole && offer.read ? `${read}/${asked} read` : "not whole";
    const made = h(
      "li",
      { class: "proposed", onpointerenter: () => layer.point(offer), onpointerleave: () => layer.point(null), onfocusin: ({ target }) => target.matches(":focus-visible") && layer.point(offer), onfocusout: () => layer.point(null) },
      h("div", { class: "row" }, h("span", { class: `dot ${isGood ? "good" : offer.is_whole ? "warn" : ""}` }), h("span", { class: "name" }, name), h("button", { class: "remove", "aria-label": `Dismiss ${name}`, title: "Dismiss (Delete)", onclick: () => search.dismiss(offer) }, "×")),
      h("button", { class: "accept", "aria-label": `Accept ${name}`, title: isAnchors ? "" : "Accept it as it is; everything stays editable", onclick: () => search.accept(offer) }, "Accept"),
      h("details", {}, h("summary", {}, how), evidenceOf(offer)),
      lackingOf(offer),
    );
    made.offer = offer;
    return made;
  }

  // Rows come and go one by one; where the focus was in one that went, it goes on to the next.
  function showRows(offers) {
    const held = list.contains(document.activeElement) ? [...list.children].indexOf(document.activeElement.closest("li")) : -1;
    for (const [offer, each] of rows) {
      if (offers.includes(offer)) continue;
      each.remove();
      rows.delete(offer);
    }
    offers.forEach((offer, place) => {
      if (!rows.has(offer)) rows.set(offer, row(offer));
      if (list.children[place] !== rows.get(offer)) list.insertBefore(rows.get(offer), list.children[place] || null);
    });
    if (held < 0 || list.contains(document.activeElement)) return;
    const next = list.children[Math.min(held, list.children.length - 1)]?.querySelector(".accept");
    (next || byId("picture")).focus({ preventScroll: true });
  }

  function hint(offers, isEmpty) {
    if (search.isRunning) return `${upper(search.looking.said)} … (D stops)`;
    if (offers.length && !search.hasAccepted) return "Click on a dashed ring to accept it: it becomes an ordinary gauge.";
    return isEmpty && search.key === undefined ? "Find dials (D) looks for dials, scales and anchors automatically. Or draw them with the tools above." : "";
  }

  function show() {
    const { offers, sure, isRunning, dismissed } = search;
    const { anchors = [], gauges = [], level, reference_points: points = [] } = store.document;
    const isEmpty = !anchors.length && !gauges.length && !level && !points.length;
    const isFresh = search.key === undefined;
    root.hidden = !isEmpty && isFresh && !search.notes.length;
    tool.firstChild.textContent = isRunning ? "Stop" : "Find dials";
    tool.classList.toggle("called", isEmpty && isFresh);
    begin.hidden = intro.hidden = !isFresh;
    again.hidden = isFresh || isRunning;
    status.textContent = isRunning ? `${upper(search.looking.said)} …` : isFresh ? "" : search.broken || (offers.length ? "" : "Nothing more to propose.");
    const dials = sure.filter((offer) => offer !== search.anchors).length;
    all.textContent = sure.length === offers.length ? `Accept all (${dials})` : `Accept ${dials} read`;
    all.title = "All that was read on the flight, with the anchors; one undo takes it back";
    all.hidden = !dials || sure.length < 2;
    notes.replaceChildren(...search.notes.map((each) => h("p", {}, `${upper(each)}.`)));
    back.hidden = !dismissed.length;
    back.textContent = `Show ${dismissed.length} dismissed`;
    showRows(offers);
    const words = hint(offers, isEmpty);
    if (store.hint !== words) {
      store.hint = words;
      store.tell("hint");
    }
  }

  store.on("find", find);
  store.on("change found", show);
  store.on("meant", ({ detail }) => {
    for (const [offer, each] of rows) each.classList.toggle("current", offer === detail);
    if (detail && !root.matches(":hover, :focus-within")) rows.get(detail)?.scrollIntoView({ block: "nearest" });
  });
  show();
}
