// The loupe: the picture's own pixels around the cross, magnified, while places are clicked or moved to with keys.
import { byId, s } from "./dom.js";
import { kept, keep } from "./kept.js";
import { pictureAddress } from "./server.js";

const LEAST_TIMES = 8; // on the screen for one of the picture
const CLOSER = 2.5; // than the picture is shown
const LARGE_ENOUGH = 14; // pixels that are shown so large need no loupe
const BESIDE_PX = 26;
const TILE_PX = 256;
const WHOLE_PX = 1600; // a wider picture may be shown whole with fewer pixels than it has

export function showLoupe(store, view) {
  const root = byId("loupe");
  const button = byId("useloupe");
  const whole = s("image", { preserveAspectRatio: "none" });
  const tile = s("image", { preserveAspectRatio: "none" });
  const cross = s("path", { class: "cross" });
  root.append(whole, tile, cross);
  let isOn = kept("loupe") ?? true;
  let shown = "";
  let isAway = false; // the pointer has left the picture

  // Of a large picture the part around the cross, as it was taken.
  function sharpen([x, y]) {
    const [width, height] = view.size;
    if (width <= WHOLE_PX) {
      tile.removeAttribute("href");
      shown = "";
      return;
    }
    const step = TILE_PX / 2;
    const [left, top] = [x, y].map((value) => Math.max(Math.round(value / step) * step - step, 0));
    const part = { left, top, width: Math.min(TILE_PX, width - left), height: Math.min(TILE_PX, height - top) };
    if (part.width <= 0 || part.height <= 0) return;
    const address = `${pictureAddress(view.key, "part")}?${new URLSearchParams({ ...part, wanted: part.width })}`;
    if (address === shown) return;
    shown = address;
    tile.removeAttribute("href"); // until it is there the whole picture does
    const image = new Image();
    image.onload = () => {
      if (shown !== address) return;
      const place = { x: part.left - 0.5, y: part.top - 0.5, width: part.width, height: part.height, href: address };
      for (const [name, value] of Object.entries(place)) tile.setAttribute(name, value);
    };
    image.src = address;
  }

  function show() {
    button.setAttribute("aria-pressed", isOn);
    const [x, y] = store.held || store.cursor;
    const place = view.onScreen([x, y]);
    const [width, height] = view.box;
    const isSeen = place[0] >= 0 && place[1] >= 0 && place[0] <= width && place[1] <= height;
    const isWanted = isOn && isSeen && !isAway && (store.held || store.tool !== "select") && view.scale < LARGE_ENOUGH;
    root.toggleAttribute("hidden", !isWanted);
    if (!isWanted) return;
    sharpen([x, y]);
    const size = root.clientWidth;
    for (const name of ["x", "y", "width", "height", "href"]) whole.setAttribute(name, view.whole.getAttribute(name));
    const across = size / Math.max(LEAST_TIMES, CLOSER * view.scale);
    root.setAttribute("viewBox", `${x - across / 2} ${y - across / 2} ${across} ${across}`);
    const gap = across / 24; // what is aimed at stays free
    cross.setAttribute("d", `M${x - across} ${y}H${x - gap}M${x + gap} ${y}H${x + across}M${x} ${y - across}V${y - gap}M${x} ${y + gap}V${y + across}`);
    const beside = (at, room) => (at + BESIDE_PX + size <= room ? at + BESIDE_PX : Math.max(at - BESIDE_PX - size, 0));
    root.style.left = `${beside(place[0], width)}px`;
    root.style.top = `${beside(place[1], height)}px`;
  }

  const toggle = () => {
    isOn = !isOn;
    keep("loupe", isOn);
    show();
  };
  button.addEventListener("click", toggle);
  view.svg.addEventListener("pointerleave", () => {
    isAway = true;
    show();
  });
  store.on("cursor tool", () => {
    isAway = false;
    show();
  });
  store.on("looking", show);
  view.addEventListener("place", show);
  show();
  return toggle;
}
