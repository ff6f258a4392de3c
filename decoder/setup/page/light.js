// Brightness and contrast of the panel picture, for panels that were filmed in the dark: of what is shown, not of what
// is read.
import { byId, h } from "./dom.js";
import { keep, kept } from "./kept.js";

// Sliders go by factors: as far to the left halves what as far to the right doubles.
const SLIDERS = { brightness: { words: "Brightness", most: 8 }, contrast: { words: "Contrast", most: 4 } };
const STEPS = 40;
const PLAIN = 0;

export function showLight() {
  const panel = byId("light");
  const button = byId("uselight");
  const at = Object.fromEntries(Object.keys(SLIDERS).map((name) => [name, Math.max(Math.min(Number(kept(name)) || PLAIN, STEPS), -STEPS)]));
  const factor = (name) => SLIDERS[name].most ** (at[name] / STEPS);

  const sliders = Object.entries(SLIDERS).map(([name, { words }]) => {
    const slider = h("input", { type: "range", id: name, min: -STEPS, max: STEPS, step: 1, value: at[name], oninput: () => set(name, Number(slider.value)) });
    return h("label", { for: name }, h("span", {}, words), slider, h("output", { for: name }));
  });
  const reset = h("button", { id: "plainlight", class: "small", onclick: () => Object.keys(SLIDERS).forEach((name) => set(name, PLAIN)) }, "As it is");
  panel.append(...sliders, reset);

  function set(name, value) {
    at[name] = value;
    keep(name, value);
    show();
  }

  function show() {
    const isPlain = Object.values(at).every((value) => value === PLAIN);
    for (const name of Object.keys(SLIDERS)) {
      const slider = byId(name);
      const words = `${Math.round(factor(name) * 100)} %`;
      slider.value = at[name];
      slider.setAttribute("aria-valuetext", words);
      slider.nextElementSibling.textContent = words;
      document.documentElement.style.setProperty(`--${name}`, factor(name));
    }
    document.body.classList.toggle("lit", !isPlain);
    reset.disabled = isPlain;
  }

  function open(opens) {
    panel.hidden = !opens;
    button.setAttribute("aria-expanded", opens);
    if (opens) byId("brightness").focus();
    else byId("picture").focus({ preventScroll: true });
  }

  const toggle = () => open(panel.hidden);
  button.addEventListener("click", toggle);
  panel.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" && event.key.toLowerCase() !== "b") return;
    event.preventDefault();
    event.stopPropagation();
    open(false);
  });
  show();
  return toggle;
}
