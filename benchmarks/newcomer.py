"""How much a newcomer clicks and types to set up six flight instruments on the page, and what `decode` then reads.

A person is played in a real Chromium by mouse and keyboard alone: what they look at is the screen, and each click lands
a pixel beside what it means. The flight is a simulator's (`real_pictures`), so the truth of every frame is known.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.pages import markdown
from benchmarks.programs import decode
from benchmarks.real_pictures import PANELS, SOURCES, Source, truth_of
from benchmarks.setup_page import chromium, served
from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.scale import shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.setup.sources import open_source
from decoder.timeseries.tables import Table, read_table
from fixtures.recordings import record_flight

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

XY = tuple[float, float]

MOST_CLICKS, MOST_KEYS = 40, 60
OFF_PX = 1.0
VIEW = {"width": 1440, "height": 900}
SLOW_MS, SEARCH_MS = 400_000, 600_000
# What is drawn lies on the screen a frame later; nobody clicks on what is not there yet.
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
# Where on the screen a place of the picture is seen.
SEEN = """([x, y]) => {
    const place = new DOMPoint(x, y).matrixTransform(document.getElementById("picture").getScreenCTM());
    return [place.x, place.y];
}"""
# Rolls to something, and tells where on the screen it then is.
ROLLED = """(each) => {
    each.scrollIntoView({ block: "nearest" });
    const { x, y, width, height } = each.getBoundingClientRect();
    return [x, y, width, height];
}"""


@dataclass
class Person:
    """Somebody with a mouse and a keyboard; `seed` decides where beside its aim each click lands."""

    page: Page
    seed: int = 5
    clicks: int = 0
    keys: int = 0
    spent: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Clicks and keys by what they were for."""

    def __post_init__(self) -> None:
        self._chance = np.random.default_rng(self.seed)

    @contextmanager
    def doing(self, what: str) -> Iterator[None]:
        """Count what a part of the work takes."""
        clicks, keys = self.clicks, self.keys
        yield
        before = self.spent.get(what, (0, 0))
        self.spent[what] = before[0] + self.clicks - clicks, before[1] + self.keys - keys

    def point(self, place: XY) -> None:
        """Click on a place of the picture, a pixel of the picture beside it in any direction."""
        self.page.mouse.click(*self._aimed(place))
        self.clicks += 1

    def drag(self, start: XY, end: XY) -> None:
        """Drag from place to place of the picture: one press of the button."""
        self.page.mouse.move(*self._aimed(start))
        self.page.mouse.down()
        self.page.mouse.move(*self._aimed(end), steps=3)
        self.page.mouse.up()
        self.clicks += 1

    def push(self, button: Locator, at: XY = (0.5, 0.5)) -> None:
        """Click on something beside the picture once it can be; rolling there with the wheel is no click."""
        button.wait_for(timeout=SLOW_MS)
        left, top, width, height = 0.0, 0.0, 0.0, 0.0
        while not width:  # what is drawn anew at that moment has no place
            self._look()
            left, top, width, height = button.evaluate(ROLLED)
        self.page.mouse.click(left + at[0] * width, top + at[1] * height)
        self.clicks += 1

    def press(self, *keys: str) -> None:
        """Press keys, one after the other; a key held down beside another counts as well."""
        for key in keys:
            self._look()
            self.page.keyboard.press(key)
            self.keys += key.count("+") + 1 if len(key) > 1 else 1

    def type(self, text: str, then: str = "Enter") -> None:
        """Type a text where the page expects it, and end it."""
        self._look()
        self.page.keyboard.type(text)
        self.keys += len(text)
        self.press(then)

    def _look(self) -> None:
        self.page.evaluate(DRAWN)

    def _aimed(self, place: XY) -> XY:
        self._look()
        towards = self._chance.uniform(0.0, 2 * math.pi)
        x, y = place[0] + OFF_PX * math.cos(towards), place[1] + OFF_PX * math.sin(towards)
        right, down = self.page.evaluate(SEEN, [x, y])
        return float(right), float(down)


FRAME, FRAMES = 20, 90
SLIDER_PX, THUMB_PX = 380, 16
ANCHORS = ((212, 110), (266, 138)), ((186, 836), (276, 874)), ((1124, 610), (1170, 644))
"""Printed words and numerals, by two corners."""
PIXELS_A_PITCH = 63.8
"""How far the horizon shifts for ten degrees: no mark says it, the instrument's drawing does."""


@dataclass(frozen=True, slots=True)
class Instrument:
    """What somebody does to draw one: three outer ends of its marks, and what they type for them, in this order."""

    usual: str
    rim: tuple[XY, XY, XY]
    typed: tuple[str, ...]
    more: tuple[XY, ...] = ()
    """Marks that are clicked besides; their values are the grey numbers that the page shows."""
    hub: XY | None = None
    """Where its needle is seen to turn, which is clicked if the page asks for it."""
    found: str = ""
    """What the page calls it where it finds it by itself, if that is something else."""


SIX_PACK = (
    Instrument(
        "airspeed",
        ((314.1, 153.2), (201.1, 363.2), (115.7, 224.1)),
        ("40", "100", "140"),
        ((358.2, 251.0), (304.5, 345.3), (130.9, 310.2)),
    ),
    Instrument("altimeter", ((1049.5, 121.2), (1164.5, 275.4), (935.8, 278.9)), ("0",)),
    Instrument("vertical speed", ((1132.8, 815.6), (966.2, 640.7), (1132.8, 635.8)), ("-1500", "500", "")),
    Instrument(
        "turn coordinator",
        ((365.8, 713.7), (359.6, 761.0), (101.3, 761.0)),
        ("0", "1", ""),
        hub=(231.0, 715.0),
    ),
    Instrument("heading", ((717.3, 635.4), (736.9, 804.8), (566.7, 822.8)), ("0",), found="compass"),
    Instrument("attitude", ((593.4, 97.0), (749.0, 131.4), (486.6, 216.1)), ("0",), hub=(641.7, 247.7)),
)
HORIZON = 725.0, 214.5
"""A place on the horizon."""


def draw(person: Person) -> None:
    """Draw the six instruments on an empty page, and save them."""
    choose_picture(person)
    for corners in ANCHORS:
        with person.doing("anchors"):
            person.press("a")
            person.drag(*corners)
    for instrument in SIX_PACK:
        with person.doing(instrument.usual):
            dial(person, instrument)
    with person.doing("saving"):
        save(person)


def find(person: Person) -> None:
    """Let the page find what it can, accept that, draw the others, and save them."""
    page = person.page
    choose_picture(person)
    with person.doing("finding dials, accepting them"):
        person.press("d")
        page.locator("#findagain").wait_for(timeout=SEARCH_MS)
        person.push(page.locator("#acceptall"))
    there = page.locator("#outline .of-gauge .name").all_text_contents()
    for instrument in SIX_PACK:
        if (instrument.found or instrument.usual) not in there:
            with person.doing(instrument.usual):
                dial(person, instrument)
    with person.doing("saving"):
        save(person)


def choose_picture(person: Person) -> None:
    """Take a frame of the flight for the panel picture."""
    page = person.page
    begin = (THUMB_PX / 2 + FRAME / (FRAMES - 1) * (SLIDER_PX - THUMB_PX)) / SLIDER_PX
    with person.doing("the picture"):
        person.push(page.locator("#frame"), (begin, 0.5))
        person.push(page.locator("#useframe"))
        page.locator("#lookback").wait_for(state="hidden", timeout=SLOW_MS)


def dial(person: Person, instrument: Instrument) -> None:
    """Draw one instrument; what the page still offers then is taken where it says by how much it reads better."""
    page = person.page
    index = page.locator("#outline .of-gauge").count()
    if page.locator("#picture:focus").count():
        person.press("g")
    else:  # where the cursor stands in a field, letters are typed into it
        person.push(page.get_by_label("Add: Gauges"))
    for place in instrument.rim:
        person.point(place)
    drawn, asked = page.locator("#outline .of-gauge").nth(index), page.locator("#hint", has_text="Now click the hub")
    drawn.or_(asked).first.wait_for(timeout=SLOW_MS)
    if instrument.hub is not None and asked.count():
        person.point(instrument.hub)
    drawn.wait_for(timeout=SLOW_MS)
    person.push(page.locator(f'button[data-usual="{instrument.usual}"]'))
    for value in instrument.typed:
        page.wait_for_selector("#inspector input[aria-label^='value of the mark']:focus", timeout=SLOW_MS)
        person.type(value)
    if instrument.more:
        person.press("t")
        for place in instrument.more:
            person.point(place)
            page.wait_for_selector("#inspector input[aria-label^='value of the mark']:focus", timeout=SLOW_MS)
        person.press("Enter")
    if instrument.usual == "attitude":
        horizon(person, index)
    page.locator("#film .cell").first.wait_for(timeout=SLOW_MS)
    if instrument.usual == "altimeter":
        page.locator("#advising").wait_for(state="detached", timeout=SLOW_MS)
        if page.locator("#usepivot").count():
            person.push(page.locator("#usepivot"))


def horizon(person: Person, index: int) -> None:
    """Say how this horizon turns, where it stands in the picture, and how far it shifts."""
    page, path = person.page, f"gauges[{index}].attitude"
    person.push(page.locator(f'[id="f:{path}.horizon_turn"]'))
    person.type("1.5", "Tab")
    person.type(".5")
    person.press("p")
    person.point(HORIZON)
    seen = page.locator(f'[id="f:{path}.ladder"]:focus')
    seen.wait_for(timeout=SLOW_MS)
    level_px = float(seen.input_value().split()[0])
    person.type(f"0, {level_px + PIXELS_A_PITCH:.0f} 10")


def save(person: Person) -> None:
    """Save once everything is read."""
    page = person.page
    for mark in ("…", "!"):
        page.locator("#outline .of-gauge .count").filter(has_text=mark).first.wait_for(
            state="detached", timeout=SLOW_MS
        )
    person.push(page.locator("#save"))
    page.locator("#banner", has_text="Saved to").wait_for(timeout=SLOW_MS)


SOURCE = next(source for source in SOURCES if source.panel == PANELS / "sixpack.yaml")


@dataclass(frozen=True, slots=True)
class Shown:
    """What one column shows: its truth's name, its unit, a turn's value, and how far it may be off.

    `found` is the column's name where the page found its dial by itself, if that is another.
    """

    column: str
    truth: str
    unit: str
    limit: float
    turn: float | None = None
    stop: float = math.inf
    found: str = ""

    def among(self, columns: Collection[str]) -> str:
        """Its name among these."""
        return self.found if self.found in columns else self.column


SHOWN = (
    Shown("airspeed_kt", "asi_kt", "kt", 5.0),
    Shown("altitude_ft", "alt_ft", "ft", 100.0),
    Shown("vertical_speed_fpm", "vsi_fpm", "fpm", 125.0, stop=2000.0),
    Shown("turn_rate", "turn_rate_norm", "standard rates", 0.1),
    Shown("heading_deg", "hi_heading_deg", "deg", 2.5, 360.0, found="compass_deg"),
    Shown("roll_deg", "ai_roll_deg", "deg", 1.0, 360.0),
    Shown("pitch_deg", "ai_pitch_deg", "deg", 1.0),
)


@dataclass(frozen=True, slots=True)
class Held:
    """One column held against its truth, in its unit: parts of the frames with a value and read, errors of the latter.

    Where its drawing leaves all of a column in doubt, and nothing is read, they are those of all its values.
    """

    shown: Shown
    valued: float
    read: float
    mean: float
    largest: float
    within_limit: float
    within_95: float

    @property
    def holds(self) -> bool:
        """Whether 95 % of the frames have a value, and of what counts 95 % is within the limit."""
        return min(self.valued, self.within_limit) >= CONFIDENT

    @property
    def row(self) -> list[str]:
        """Of the table."""
        shown = self.shown
        return [
            shown.column, shown.unit, f"{self.valued:.0%}", f"{self.read:.0%}", f"{self.mean:.3g}",
            f"{self.largest:.3g}", f"{shown.limit:g}", f"{self.within_limit:.0%}", f"{self.within_95:.0%}",
            "yes" if self.holds else "NO",
        ]  # fmt: skip


CONFIDENT = 0.95


def held(shown: Shown, flight: Table, truth: Floats) -> Held:
    """Hold a column against its truth."""
    name = shown.among(flight.columns)
    value, sigma = flight.numbers(name), flight.numbers(f"{name}_sigma")
    error = np.abs(shortest(value - np.clip(truth, -shown.stop, shown.stop), shown.turn))
    valued, read = np.isfinite(error), np.array(flight.columns[f"{name}_status"]) == Status.READ
    known = error[valued & read] if (valued & read).any() else error[valued]
    return Held(
        shown,
        float(valued.mean()),
        float(read.mean()),
        float(known.mean()) if known.size else math.nan,
        float(known.max(initial=0.0)),
        float((known <= shown.limit).mean()) if known.size else 0.0,
        float((error <= CONFIDENCE_SIGMAS * sigma)[valued].mean()) if valued.any() else math.nan,
    )


@dataclass(frozen=True, slots=True)
class Drawn:
    """What drawing took, and what is read with what was drawn."""

    clicks: int
    keys: int
    spent: dict[str, tuple[int, int]]
    columns: list[Held]


def drawn_six_pack(browser: str, work: Callable[[Person], None], source: Source = SOURCE, seed: int = 5) -> Drawn:
    """Have a person do their work, decode the flight with the panel they saved, and hold it against the truth."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - for development only

    pictures = sorted(source.folder.glob(source.pictures))
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "theirs").mkdir()
        panel = shutil.copyfile(source.panel, folder / "theirs" / "panel.yaml")
        shutil.copyfile(source.folder / source.panel_picture, folder / "theirs" / Path(source.panel_picture).name)
        record_flight(pictures, panel, folder / "empty.mcap")
        saved = folder / "drawn" / "panel.yaml"
        saved.parent.mkdir()
        with sync_playwright() as playwright, served(open_source([folder / "empty.mcap"]), saved, saved) as url:
            chrome = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
            page = chrome.new_page(viewport=VIEW)  # type: ignore[arg-type]
            page.goto(url)
            page.wait_for_selector("body[data-ready]")
            person = Person(page, seed)
            work(person)
            chrome.close()
        record_flight(pictures, saved, folder / "flight.mcap")
        decode(folder / "flight.mcap", folder)
        flight, truth = read_table(folder / "flight.csv"), truth_of(source, [picture.stem for picture in pictures])
        columns = [held(shown, flight, truth[shown.truth]) for shown in SHOWN]
    return Drawn(person.clicks, person.keys, person.spent, columns)


LEGEND = """\
Six flight instruments of a simulator's cockpit (airspeed, altimeter, vertical speed, turn coordinator, heading,
attitude), from an empty page in Chromium by mouse and keyboard, each click a pixel of the picture beside what it means,
in a direction by chance. A press of the mouse's button is a click, also where it drags; every key counts. Then `decode`
reads all 90 frames with that panel, beside the simulator's own values.

The limits are what 14 CFR 91 Appendix E, note 1, lets a recording add to what an instrument shows, 100 ft of altitude,
and a tenth of a standard rate. A column holds if 95 % of the frames have a value, and 95 % of what is `read` is within
its limit; errors are absolute, and those of what is `read`. Where nothing is, all values count: a pixel beside a turn
coordinator's marks, which stand 20 degrees apart, leaves all of its scale in doubt, and every value says so. `in 95 %`
is the part of all values whose truth lies within 1.96 sigma.
"""
WORKS: Mapping[str, Callable[[Person], None]] = {
    "The page finds what it can, the rest is drawn": find,
    "All of it drawn by hand": draw,
}


def newcomer_page(seed: int = 5) -> str:
    """The page on what a newcomer needs."""
    browser = chromium()
    if browser is None or not any(SOURCE.folder.glob(SOURCE.pictures)):
        return "Not measured: there is no Chromium on this machine, or the pictures are not there.\n"
    parts = [f"### {title}\n\n{_tables(drawn_six_pack(browser, work, seed=seed))}" for title, work in WORKS.items()]
    return "\n".join([LEGEND, *parts])


def _tables(drawn: Drawn) -> str:
    """What it took, and what came of it."""
    enough = drawn.clicks <= MOST_CLICKS and drawn.keys <= MOST_KEYS
    spent = [[what, str(clicks), str(keys)] for what, (clicks, keys) in drawn.spent.items()]
    total = ["together", str(drawn.clicks), str(drawn.keys)]
    most = [f"at most{'' if enough else ': NOT HELD'}", str(MOST_CLICKS), str(MOST_KEYS)]
    header = ["column", "unit", "valued", "read", "mean", "largest", "limit", "within it", "in 95 %", "holds"]
    counts = markdown(["drawing", "clicks", "keys"], [*spent, total, most])
    return f"{counts}\n\n{markdown(header, [each.row for each in drawn.columns])}\n"
