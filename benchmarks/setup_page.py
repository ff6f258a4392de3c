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

from benchmarks.pages import markdown
from benchmarks.sized_flights import SIZES, sized_flight
from decoder.setup.app import setup_server
from decoder.setup.session import SetupSession
from decoder.setup.sources import FlightSource, PictureSource
from flight_file.reader import Flight

FIXTURES = Path(__file__).parents[1] / "fixtures"
NEEDLES = 7
ROUNDS = 24
# Before each key: at once, while the change before is tried on the flight, and when all is quiet.
PAUSES_MS = (0, 200, 300, 400, 800, 1600)
REQUIRED_MS = 150
FIRST_MS = 120_000
CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
LEGEND = """\
A flight of the demo's cockpit in pictures of 4896 x 3672, opened in Chromium on the same machine. A change is one press
of an arrow key; it is answered when the screen shows the gauge unwrapped as now drawn, or, after a zoom, the picture's
own pixels. Keys are pressed 0 to 1.6 s after the previous answer, so that many arrive while twenty frames of the flight
are still being read for the previous change.
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
        return [self.what, f"{middle:.0f}", f"{worst:.0f}", str(REQUIRED_MS), "yes" if worst <= REQUIRED_MS else "NO"]


@contextmanager
def served(source: PictureSource, panel: Path | None, target: Path) -> Iterator[str]:
    """The address of a page that is served meanwhile."""
    cv2.setNumThreads(1)  # as `decode setup` does
    server = setup_server(SetupSession(source, panel, target))
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
        flight = sized_flight(Path(name), SIZES[-1], NEEDLES)
        source = FlightSource(Flight(flight.segments, flight.attachments))
        with served(source, None, Path(name) / "panel.yaml") as url:
            page = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"]).new_page(
                viewport={"width": 1500, "height": 940}
            )
            page.goto(url)
            page.wait_for_selector("body[data-ready]")
            page.locator("#outline li button").last.click()
            page.locator("#film .cell").nth(19).wait_for(timeout=FIRST_MS)
            nudged = []
            for number in range(ROUNDS):
                page.wait_for_timeout(PAUSES_MS[number % len(PAUSES_MS)])
                nudged.append(page.evaluate(MEASURE, ["key", "#unwrapped img", "src", "ArrowRight"]))
            page.keyboard.press("f")
            page.wait_for_timeout(1000)
            keys = ["+", "-"] * (ROUNDS // 2)
            zoomed = tuple(
                page.evaluate(MEASURE, ["key", "#picture image:nth-of-type(2)", "href", key]) for key in keys
            )
    return [
        Answered("the unwrapped gauge after a nudge", tuple(nudged)),
        Answered("the picture's own pixels after a zoom", zoomed),
    ]


def setup_page() -> str:
    """The page on how fast the set-up page answers."""
    browser = chromium()
    if browser is None:
        return "Not measured: there is no Chromium on this machine.\n"
    header = ["answer", "median ms", "worst ms", "required", "holds"]
    return f"{LEGEND}\n{markdown(header, [each.row for each in measured(browser)])}\n"
