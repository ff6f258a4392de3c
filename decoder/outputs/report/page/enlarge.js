// A frame as large as the window: all of it if the report holds it, or else its gauges where they lie in it.
import { byId, s } from "./dom.js";

const ENOUGH_PX = 640; // so wide a frame needs no help by its gauges

export function enlarge(title, { size, whole, frame, gauges }, shapes) {
  const [width, height] = size;
  const crops = (gauges || []).filter(({ jpeg }) => jpeg).sort((one, other) => other.box[2] * other.box[3] - one.box[2] * one.box[3]);
  const picture = whole || frame;
  const isLarge = picture && picture.px >= ENOUGH_PX;
  const parts = isLarge ? [picture] : [...(picture ? [picture] : []), ...crops]; // gauges are sharper by themselves
  byId("enlarged-title").textContent = title;
  byId("enlarged-says").textContent = isLarge ? "The whole frame, made smaller." : `${picture ? "The whole frame, coarse but for its gauges" : "Only the gauges of this frame are in the report"}; \`decode frames\` writes all of it.`;
  byId("enlarged-picture").replaceChildren(
    s("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title },
      ...parts.map(({ box: [x, y, wide, high], jpeg }) => s("image", { href: `data:image/jpeg;base64,${jpeg}`, x, y, width: wide, height: high, preserveAspectRatio: "none" })),
      ...shapes),
  );
  const dialog = byId("enlarged");
  if (!dialog.open) dialog.showModal();
}

export function useEnlarged(state, draw) {
  const dialog = byId("enlarged");
  byId("enlarged-close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  state.on("row", () => dialog.open && draw());
}
