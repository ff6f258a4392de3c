// The page's colours as the plots need them: from the style sheet, by day, by night and on paper.
export function palette() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: colour("text"),
    quiet: colour("quiet"),
    line: colour("line"),
    curve: colour("curve"),
    band: colour("band"),
    truth: colour("truth"),
    accent: colour("accent"),
    bad: colour("bad"),
    surface: colour("surface"),
    status: (name) => colour(`status-${name}`),
  };
}
