// A frame as large as the window: all of it if the report holds it, or else its gauges where they lie in it.
import { byId, s } from "./dom.js";

export function enlarge(title, { size, whole, frame, gauges }, shapes) {
  const [width, height] = size;
  const picture = whole || frame;
  const parts = picture ? [picture] : gauges;
  byId("enlarged-title").textContent = title;
  byId("enlarged-says").textContent = picture ? "The whole frame, made smaller." : "The report holds the gauges of this frame, not the rest of it; `decode frames` writes all of it.";
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
