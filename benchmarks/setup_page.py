"""How fast the set-up page answers on a picture of 18 megapixels, in a real Chromium."""

from __future__ import annotations

import shutil
import statistics
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import yaml

from benchmarks.pages import markdown
from decoder.setup.server import setup_server
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source

FIXTURES = Path(__file__).parents[1] / "fixtures"
SIZE_PX = (4896, 3672)  # the QX10's
SCALE = 4.78
ROUNDS = 25
REQUIRED_MS = 150
CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
LEGEND = """\
The demo's panel picture enlarged to 4896 x 3672, opened in Chromium on the same machine. A change is a press of an
arrow key; it is answered when the unwrapped gauge of the changed drawing is on the screen, or the picture's own pixels
after a zoom.
"""

# Runs an action on the page and resolves with the milliseconds until an element's attribute changes and is painted.
MEASURE = """
([action, selector, attribute, key]) => new Promise((resolve) => {
  const seen = document.querySelector(selector);
  const begun = performance.now();
  new MutationObserver((_, observer) => {
    observer.disconnect();
    requestAnimationFrame(() => requestAnimationFrame(() => resolve(performance.now() - begun)));
  }).observe(seen, { attributes: true, attributeFilter: [attribute] });
  const picture = document.getElementById("picture");
  picture.focus();
  picture.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
})
"""


@dataclass(frozen=True, slots=True)
class Answered:
    """How long answers took: one kind of change."""

    what: str
    times_ms: tuple[float, ...]

    @property
    def row(self) -> list[str]:
        """Of the table."""
        middle, worst = statistics.median(self.times_ms), max(self.times_ms)
        return [self.what, f"{middle:.0f}", f"{worst:.0f}", str(REQUIRED_MS), "yes" if middle <= REQUIRED_MS else "NO"]


def enlarged(folder: Path) -> tuple[Path, Path]:
    """A picture of 18 megapixels and its panel."""
    small = cv2.imread(str(FIXTURES / "panel.jpg"))
    large = cv2.resize(np.asarray(small), SIZE_PX, interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(folder / "panel.jpg"), large, [cv2.IMWRITE_JPEG_QUALITY, 95])
    panel = yaml.safe_load((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))
    panel["level"] = [[x * SCALE, y * SCALE] for x, y in panel["level"]]
    for anchor in panel["anchors"]:
        anchor["box"] = [round(edge * SCALE) for edge in anchor["box"]]
    for gauge in panel["gauges"]:
        gauge["centre"] = [at * SCALE for at in gauge["centre"]]
        gauge["radius"] = [radius * SCALE for radius in gauge["radius"]]
    (folder / "panel.yaml").write_text(yaml.safe_dump(panel), encoding="utf-8")
    return folder / "panel.jpg", folder / "panel.yaml"


@contextmanager
def served(picture: Path, panel: Path | None, target: Path) -> Iterator[str]:
    """The address of a page that is served meanwhile."""
    server = setup_server(SetupSession(open_source([picture]), panel, target))
    server.listening.listen()
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        yield server.url
    finally:
        server.server.should_exit = True
        thread.join(10.0)


def chromium() -> str | None:
    """Where a Chromium is, if there is one."""
    return next((path for name in CHROMIUMS if (path := shutil.which(name))), None)


def measured(browser: str) -> list[Answered]:
    """How long the page takes to answer."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - for development only

    with TemporaryDirectory() as name, sync_playwright() as playwright:
        picture, panel = enlarged(Path(name))
        with served(picture, panel, panel) as url:
            page = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"]).new_page(
                viewport={"width": 1500, "height": 940}
            )
            page.goto(url)
            page.wait_for_selector("body[data-ready]")
            page.locator("#outline li button").last.click()
            page.wait_for_selector("#film .cell")
            unwrapped = ["key", "#unwrapped img", "src", "ArrowRight"]
            nudged = tuple(page.evaluate(MEASURE, unwrapped) for _ in range(ROUNDS))
            page.keyboard.press("f")
            page.wait_for_timeout(1000)
            keys = ["+", "-"] * (ROUNDS // 2)
            zoomed = tuple(
                page.evaluate(MEASURE, ["key", "#picture image:nth-of-type(2)", "href", key]) for key in keys
            )
    return [
        Answered("the unwrapped gauge after a nudge", nudged),
        Answered("the picture's own pixels after a zoom", zoomed),
    ]


def setup_page() -> str:
    """The page on how fast the set-up page answers."""
    browser = chromium()
    if browser is None:
        return "Not measured: there is no Chromium on this machine.\n"
    header = ["answer", "median ms", "worst ms", "required", "holds"]
    return f"{LEGEND}\n{markdown(header, [each.row for each in measured(browser)])}\n"
