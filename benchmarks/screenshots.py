"""`python -m benchmarks.screenshots`: takes the documents' pictures of the real pages, in dark and in light."""

from __future__ import annotations

import re
import sys
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import av
import cv2
import numpy as np
from playwright.sync_api import Browser, expect, sync_playwright

from benchmarks.programs import RENDERED
from benchmarks.setup_page import FIXTURES, chromium, served
from decoder.outputs.film import drawn_film, write_film
from decoder.outputs.frame_picture import flagged, matched_frames
from decoder.outputs.report.report import write_report
from decoder.panel.vocabulary import Method
from decoder.parallel.decoding import decoded_flight
from decoder.setup.sources import open_source
from flight_file.reader import open_flight

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
VIEW = {"width": 1440, "height": 900}
COMMON, RARE = 190, 64
SLOW_MS = 120_000
FILM_HEIGHT_PX, FILM_CRF = 1080, 18
# Flights on whose set-up pages a gauge is looked at, and what the pictures are called.
SETUPS = (
    ("thesis_a1.mcap", "fuel_flow", "setup"),
    ("oblique/t1a_small.mcap", "itt_1", "setup_oblique"),
)


def main() -> int:
    """Takes all pictures."""
    path = chromium()
    if path is None:
        sys.stderr.write("there is no Chromium on this machine; apt-get install chromium\n")
        return 1
    PICTURES.mkdir(exist_ok=True)
    with sync_playwright() as playwright, TemporaryDirectory() as name:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        setup_pictures(browser, Path(name))
        found_picture(browser, Path(name), PICTURES / "setup_found_dark.png")
        report = Path(name) / "flight.html"
        written_report(report)
        film_picture(Path(name) / "film.mp4", PICTURES / "film.png")
        for scheme in ("dark", "light"):
            report_picture(browser, report, scheme, PICTURES / f"report_{scheme}.png")
        browser.close()
    return 0


def setup_pictures(browser: Browser, folder: Path) -> None:
    """The set-up pages, served from a folder of their own: they show where they save, as it was given."""
    for flight, gauge, stem in SETUPS:
        with chdir(folder), served(open_source([FIXTURES / flight]), None, Path("panel.yaml")) as url:
            for scheme in ("dark", "light"):
                setup_picture(browser, url, scheme, gauge, PICTURES / f"{stem}_{scheme}.png")


def setup_picture(browser: Browser, url: str, scheme: str, gauge: str, path: Path) -> None:
    """The set-up page with a gauge selected and read."""
    page = browser.new_page(viewport=VIEW, color_scheme="dark" if scheme == "dark" else "light")  # type: ignore[arg-type]
    page.goto(url)
    page.wait_for_selector("body[data-ready]")
    page.locator("#outline li button", has_text=gauge).click()
    page.locator("#picture").press("f")
    page.locator("#film .cell").nth(19).wait_for(timeout=SLOW_MS)
    expect(page.locator("#outline .of-gauge .count").filter(has_text="…")).to_have_count(0, timeout=SLOW_MS)
    expect(page.locator("#subtitle")).to_have_text(re.compile("saves to panel.yaml$"))
    page.wait_for_timeout(500)
    save_small(page.screenshot(), path)
    page.close()


def found_picture(browser: Browser, folder: Path, path: Path) -> None:
    """The set-up page with dials that it found, pointed at the one that is whole."""
    flight = open_source([FIXTURES / "thesis_a2.mcap"])
    with chdir(folder), served(flight, Path("new.yaml"), Path("panel.yaml")) as url:
        page = browser.new_page(viewport=VIEW, color_scheme="dark")  # type: ignore[arg-type]
        page.goto(url)
        page.wait_for_selector("body[data-ready]")
        page.keyboard.press("d")
        page.locator("#findagain").wait_for(timeout=3 * SLOW_MS)
        page.locator("#picture").hover(position={"x": 350, "y": 200})
        page.mouse.wheel(0, -320)
        page.locator("#found .proposed", has_text="20/20").hover()
        page.wait_for_timeout(500)
        save_small(page.screenshot(), path)
        page.close()


def written_report(path: Path) -> None:
    """The report of a flight with reflections and covered needles, the long one if it was rendered."""
    long = RENDERED / "reflections.mcap"
    flight = open_flight([long if long.exists() else FIXTURES / "thesis_a2.mcap"])
    with path.open("wb") as stream:
        write_report(decoded_flight(flight, None, Method.NORMXCORR.value), stream)


def film_picture(film: Path, path: Path) -> None:
    """A picture out of the film of a flight with its readings: the first in which a value was not plainly read."""
    flight = decoded_flight(open_flight([FIXTURES / "thesis_a2.mcap"]), None, Method.NORMXCORR.value)
    frames = enumerate(matched_frames(flight.data, flight.frames))
    write_film(drawn_film(flight, frames, FILM_HEIGHT_PX, print), film, FILM_CRF)
    with av.open(str(film)) as container:
        shown = list(container.decode(video=0))[int(flagged(flight.data)[0])]
    pixels = cv2.cvtColor(np.asarray(shown.to_ndarray(format="rgb24"), np.uint8), cv2.COLOR_RGB2BGR)
    save_small(cv2.imencode(".png", pixels)[1].tobytes(), path)


def report_picture(browser: Browser, report: Path, scheme: str, path: Path) -> None:
    """The report with a frame in which a needle is hidden."""
    page = browser.new_page(viewport=VIEW, color_scheme="dark" if scheme == "dark" else "light")  # type: ignore[arg-type]
    page.goto(report.as_uri())
    page.wait_for_selector("body[data-ready]")
    page.locator("#flags tr[data-kind=interpolated] button").nth(1).click()
    page.keyboard.press("0")
    page.wait_for_timeout(1500)
    page.evaluate("window.scrollTo({ top: 0, behavior: 'instant' })")
    page.wait_for_timeout(500)
    save_small(page.screenshot(), path)
    page.close()


def save_small(png: bytes, path: Path) -> None:
    """A picture in few colours, which is a third of the size and looks the same."""
    from PIL import Image  # noqa: PLC0415

    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    whole = Image.fromarray(cv2.cvtColor(np.asarray(picture), cv2.COLOR_BGR2RGB))
    # The commonest colours, and with them the rare ones in which things are drawn.
    common, rare = whole.quantize(COMMON), whole.quantize(RARE, Image.Quantize.MAXCOVERAGE)
    palette = Image.new("P", (1, 1))
    palette.putpalette((common.getpalette() or [])[: 3 * COMMON] + (rare.getpalette() or [])[: 3 * RARE])
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
