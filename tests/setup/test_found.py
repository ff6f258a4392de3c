"""What is found on the page: proposed over the picture with its evidence, accepted or dismissed by one click."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Locator, Page, expect

from decoder.panel.scale import Scale
from decoder.setup.drafts import Superseded
from decoder.setup.drawn_plane import DrawnPlane
from decoder.setup.finding.numerals import is_there
from decoder.setup.finding.proposal import ProposedGauge, SeenMark
from decoder.setup.proposing.search import Anchors, Looking, Step, Withdrawn, search
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source
from tests.programs import ran, until, yaml_of
from tests.setup.hand import Hand, OpenPage, Start

Searched = Callable[..., None]

# The first two dials of the flight, and how the first one is drawn rightly.
CENTRES = (297.3, 168.4), (467.6, 168.7)
RING_PX = 51.0
MARKS = {60.0: 150.0, 80.0: 255.4545, 100.0: 360.909}
READ = {
    "name": "tachometer",
    "centre": list(CENTRES[0]),
    "radius": [20.0, 52.0],
    "sweep": [110.0, 440.0],
    "unit": "%",
    "scale": [[angle, value] for value, angle in MARKS.items()],
    "needles": [{"name": "tachometer_pct", "template": {"at": 359.5, "span": 16}}],
}
ANCHORS = Anchors(
    (
        {"name": "anchor_1", "box": [116, 250, 30, 30]},
        {"name": "anchor_2", "box": [892, 491, 30, 30]},
        {"name": "anchor_3", "box": [680, 28, 30, 30]},
    ),
    19,
)


def proposal(centre: tuple[float, float], name: str, **more: Any) -> ProposedGauge:  # noqa: ANN401 - any of its parts
    """A proposal that is not whole: its scale is in doubt."""
    drawn = DrawnPlane.square_on(centre)
    marks = tuple(
        SeenMark(value, f"{value:g}", 0.98, drawn.place(angle, 34.0), drawn.place(angle, RING_PX))
        for value, angle in MARKS.items()
    )
    so_far = {**READ, "name": name, "centre": list(centre), "unit": "", "needles": []}
    plain = ProposedGauge(
        gauge=None,
        drawn={**so_far, "scale": [[angle, None] for angle in MARKS.values()]},
        centre=centre,
        rim=tuple((float(x), float(y)) for x, y in drawn.ring(RING_PX).T),
        name=name,
        marks=marks,
        evidence=("20 ticks around one point",),
        lacking=("no scale: only 3 numerals with a mark of their own",),
    )
    return replace(plain, **more)


WHOLE = proposal(CENTRES[0], "tachometer", gauge=READ, lacking=(), read=(20, 20))
PART = proposal(CENTRES[1], "dial")


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Searched:
    """Gives the page steps of a search that took no time."""

    def give(*steps: Step) -> None:
        monkeypatch.setattr("decoder.setup.app.tried_search", lambda *_: iter(steps))

    return give


def offered(page: Page) -> Locator:
    """The list of what waits for an answer."""
    return page.locator("#found li.proposed")


def names(page: Page) -> list[str]:
    """Of all in the list."""
    return [each.inner_text() for each in offered(page).locator(".row .name").all()]


def find(page: Page, count: int) -> Hand:
    """Finds dials by the key, until so many proposals wait."""
    hand = Hand(page)
    hand.press("d")
    expect(offered(page)).to_have_count(count)
    expect(page.locator("#find")).to_contain_text("Find dials")
    return hand


def test_one_click_accepts_and_one_step_takes_it_back(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """Over the picture each value stands at its mark; a click makes it a gauge that is read, with its anchors."""
    searched(Looking("looking for anchors"), ANCHORS, WHOLE, PART)
    page = open_page(start())
    expect(page.locator("#hint")).to_contain_text("Find dials")
    hand = find(page, 3)
    assert names(page) == ["3 anchors", "tachometer", "dial"]
    ring = page.locator("#proposals .proposal").filter(has_text="tachometer")
    assert ring.locator(".mark text").all_text_contents() == ["60", "80", "100"]
    expect(ring.locator(".axis")).to_have_count(1)
    expect(offered(page).nth(1)).to_contain_text("20/20 read")
    expect(offered(page).nth(2)).to_contain_text("No scale: only 3 numerals")

    hand.click((CENTRES[0][0] + 20, CENTRES[0][1] + 20))

    expect(page.locator("#outline .of-gauge .count")).to_have_text("20/20")
    expect(page.locator('[id="f:gauges[0].needles[0].name"]')).to_have_value("tachometer_pct")
    expect(page.locator("#outline .of-anchor")).to_have_count(3)
    assert names(page) == ["dial"]
    page.locator("#undo").click()
    expect(page.locator("#outline .of-gauge")).to_have_count(0)
    expect(page.locator("#outline .of-anchor")).to_have_count(0)
    assert names(page) == ["3 anchors", "tachometer", "dial"]


def test_all_that_was_read_is_accepted_at_once_and_saved(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """What is not whole stays; a name that is taken already gets a number, in its columns too."""
    again = replace(WHOLE, gauge={**READ, "centre": [637.3, 168.1]}, centre=(637.3, 168.1))
    searched(ANCHORS, WHOLE, PART, again)
    running = start()
    page = open_page(running)
    hand = find(page, 4)

    page.locator("#acceptall").click()

    expect(page.locator("#outline .of-gauge .count").first).to_have_text("20/20")
    assert names(page) == ["dial"]
    hand.save()
    panel = yaml_of(running.session.target)
    assert [each["name"] for each in panel["gauges"]] == ["tachometer", "tachometer_1"]
    assert [each["needles"][0]["name"] for each in panel["gauges"]] == ["tachometer_pct", "tachometer_pct_2"]
    assert panel["anchors"] == list(ANCHORS.anchors)
    page.locator("#undo").click()
    expect(page.locator("#outline .of-gauge")).to_have_count(0)


def test_what_is_not_whole_is_accepted_as_it_is(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """Its marks come along without the values that are in doubt, and the page says what is missing."""
    searched(ANCHORS, PART)
    page = open_page(start())
    hand = find(page, 2)
    ring = page.locator("#proposals .proposal").filter(has_text="dial")
    assert ring.locator(".mark text").all_text_contents() == ["60?", "80?", "100?"]
    hand.click(CENTRES[1])
    values = page.locator("#inspector input[aria-label^='value of the mark']")
    expect(values).to_have_count(3)
    assert [each.input_value() for each in values.all()] == ["", "", ""]
    expect(page.locator("#film")).to_contain_text("still needs a needle, two tick marks with their values")


def test_what_is_dismissed_stays_away(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """By keys alone, also when dials are found again; until it is asked for. On a small screen the list unfolds."""
    searched(ANCHORS, WHOLE, PART)
    page = open_page(start())
    page.set_viewport_size({"width": 720, "height": 450})
    hand = find(page, 3)
    hand.press("d")
    page.keyboard.press("Delete")
    expect(offered(page)).to_have_count(2)
    page.keyboard.press("Backspace")
    expect(offered(page)).to_have_count(1)
    page.locator("#findagain").click()
    expect(page.locator("#findagain")).to_be_visible()
    assert names(page) == ["dial"]
    page.locator("#undismiss").click()
    assert names(page) == ["3 anchors", "tachometer", "dial"]
    hand.press("d")
    page.keyboard.press("Tab")
    page.locator("#found .accept").nth(2).focus()
    page.keyboard.press("Enter")
    expect(page.locator("#outline .of-gauge")).to_have_count(1)
    expect(page.locator('[id="f:gauges[0].name"]')).to_have_value("dial")
    expect(offered(page)).to_have_count(1)
    expect(offered(page)).to_be_visible()
    page.locator("#findagain").focus()
    page.keyboard.press("Backspace")
    expect(page.locator("#outline .of-gauge")).to_have_count(1)


def test_nothing_is_proposed_over_what_is_drawn(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """A dial drawn by hand hides what was found there, a little beside it; and one withdrawn is gone."""
    searched(ANCHORS, WHOLE, PART, proposal((382.0, 168.0), "no dial"), Withdrawn(2))
    page = open_page(start())
    hand = Hand(page)
    hand.press("g")
    for angle in MARKS.values():
        turn = math.radians(angle)
        hand.click((CENTRES[0][0] + RING_PX * math.cos(turn), CENTRES[0][1] + RING_PX * math.sin(turn)))
    expect(page.locator("#outline .of-gauge")).to_have_count(1)
    hand.press("Escape")
    find(page, 2)
    assert names(page) == ["3 anchors", "dial"]


def test_another_picture_ends_the_search_and_drops_what_was_found(
    start: Start, open_page: OpenPage, searched: Searched, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody waits for more, and the next begins; a level edge and a first reference point change nothing yet."""
    ended = []

    def endless(*asked: Any) -> Iterator[Step]:  # noqa: ANN401 - as of a search
        yield from (ANCHORS, WHOLE, Looking("looking at a dial around 470, 166", (420.0, 116.0, 100.0, 100.0)))
        *_, stale = asked
        until(stale)  # a long step, and nobody waits for more
        ended.append(True)

    monkeypatch.setattr("decoder.setup.app.tried_search", endless)
    page = open_page(start())
    Hand(page).press("d")
    expect(page.locator("#looking")).to_contain_text("Looking at a dial around 470, 166")
    expect(page.locator("#hint")).to_contain_text("Looking at a dial")
    expect(page.locator("#proposals .looked")).to_have_count(1)
    expect(offered(page)).to_have_count(2)
    Hand(page).level([[120, 100], [120, 300]])
    Hand(page).press("r")
    Hand(page).click((300, 300))
    expect(page.locator("#outline .of-reference")).to_have_count(1)
    page.locator("#picture").focus()
    expect(offered(page)).to_have_count(2)
    expect(page.locator("#looking")).to_contain_text("Looking at a dial")
    page.locator("#frame").evaluate("(slider) => { slider.value = 7; slider.dispatchEvent(new Event('input')); }")
    page.locator("#useframe").click()

    expect(offered(page)).to_have_count(0)
    expect(page.locator("#proposals > *")).to_have_count(0)
    expect(page.locator("#found .notes")).to_contain_text("another picture")
    until(lambda: ended)
    searched(PART)
    find(page, 1)


def test_what_was_read_is_only_ever_text(start: Start, open_page: OpenPage, searched: Searched) -> None:
    """Print on a panel may say anything: none of it becomes a part of the page."""
    hostile = "<img src=x onerror=alert(1)>"
    marks = tuple(replace(mark, said=hostile) for mark in WHOLE.marks)
    said = (f"numerals {hostile}",)
    searched(replace(WHOLE, name=hostile, marks=marks, evidence=said, lacking=said))
    page = open_page(start())
    find(page, 1)
    page.locator("#found details summary").click()
    offered(page).hover()
    expect(page.locator("#foundcard")).to_contain_text(hostile)
    expect(page.locator("#proposals")).to_contain_text(hostile[:8])
    expect(page.locator("#found img, #foundcard img, #proposals img")).to_have_count(0)


def test_a_search_that_fails_is_said(start: Start, open_page: OpenPage, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was found until then stays, and the page goes on; what was accepted and then withdrawn is said too."""
    going_on, is_said = threading.Event(), threading.Event()

    def failing(*_: object) -> Iterator[Step]:
        yield from (WHOLE, PART)
        going_on.wait(60)
        yield Withdrawn(0)
        is_said.wait(60)  # a connection that breaks takes along what is still on its way
        raise RuntimeError("nobody expected this")

    monkeypatch.setattr("decoder.setup.app.tried_search", failing)
    page = open_page(start(), quiet=False)
    Hand(page).press("d")
    expect(offered(page)).to_have_count(2)
    page.locator("#found .accept").first.click()
    going_on.set()
    expect(page.locator("#found .notes")).to_contain_text("The dial that you accepted as tachometer turned out")
    is_said.set()
    expect(page.locator("#banner")).to_contain_text("ended before its time")
    expect(page.locator("#looking")).to_have_text("Not finished.")
    expect(page.locator("#found .notes")).to_contain_text("The dial that you accepted as tachometer turned out")
    assert names(page) == ["dial"]
    expect(page.locator("#findagain")).to_be_visible()


SIZE = 480, 640
CENTRE, RADIUS_PX = (400.4, 238.7), 150.0
SCALE = {value: 135.0 + 2.7 * value for value in range(0, 101, 10)}
VALUES = (12.0, 31.0, 44.0, 55.0, 63.0, 78.0, 86.0, 95.0)


def frame(value: float) -> NDArray[np.uint8]:
    """A panel of knobs like no others, and an airspeed indicator of a formula that shows a value; drawn large."""
    chance = np.random.default_rng(11)
    large = np.full((SIZE[0] * 4, SIZE[1] * 4), 70, np.uint8)
    for row in range(4):
        for column in range(2):
            patch = cv2.resize(chance.integers(0, 255, (6, 6), np.uint8), (120, 120), interpolation=cv2.INTER_NEAREST)
            top, left = 240 + 420 * row + 40 * column, 120 + 380 * column
            large[top : top + 120, left : left + 120] = patch

    def place(angle_deg: float, part: float) -> tuple[int, int]:
        turn = math.radians(angle_deg)
        x, y = (CENTRE[axis] + part * RADIUS_PX * side for axis, side in enumerate((math.cos(turn), math.sin(turn))))
        return round(4 * x + 1.5), round(4 * y + 1.5)

    cv2.circle(large, place(0.0, 0.0), round(4 * 1.25 * RADIUS_PX), 25, -1, cv2.LINE_AA)
    for tenth in range(51):
        cv2.line(
            large,
            place(135.0 + 5.4 * tenth, 0.85 if tenth % 5 == 0 else 0.92),
            place(135.0 + 5.4 * tenth, 1.0),
            225,
            11,
        )
    for text, (x, y) in [(str(each), place(angle, 0.68)) for each, angle in SCALE.items()] + [
        ("AIRSPEED", place(90.0, 0.72)), ("KNOTS", place(90.0, 0.9))
    ]:  # fmt: skip
        (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 2.2, 6)
        cv2.putText(large, text, (x - wide // 2, y + high // 2), cv2.FONT_HERSHEY_SIMPLEX, 2.2, 225, 6, cv2.LINE_AA)
    cv2.line(large, place(SCALE[0] + 2.7 * value, -0.15), place(SCALE[0] + 2.7 * value, 0.55), 250, 22, cv2.LINE_AA)
    small = cv2.resize(large, SIZE[::-1], interpolation=cv2.INTER_AREA).astype(np.float64)
    noise = np.random.default_rng(round(value)).normal(0, 1.5, small.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(small, (0, 0), 0.6) + noise, 0, 255), np.uint8)


@pytest.fixture(scope="module")
def airspeed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight of that panel."""
    folder = tmp_path_factory.mktemp("airspeed")
    (folder / "frames").mkdir()
    for number, value in enumerate(VALUES):
        cv2.imwrite(str(folder / "frames" / f"f{number}.jpg"), frame(value), [cv2.IMWRITE_JPEG_QUALITY, 95])
    ran("recorder", "replay", folder / "frames", "-o", folder / "flight.mcap", "--rate", "4")
    return folder / "flight.mcap"


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="numerals are read by the extra `ocr`")
def test_a_drawn_dial_is_found_accepted_and_read(start: Start, open_page: OpenPage, airspeed: Path) -> None:
    """From an empty page by one key and one click to values that are true; the program still logs its faults then."""
    running = start(airspeed)
    page = open_page(running)
    Hand(page).press("d")
    expect(page.locator("#findagain")).to_be_visible(timeout=120_000)
    assert "airspeed" in names(page)

    page.locator("#acceptall").click()
    expect(page.locator("#outline .of-gauge .count")).to_have_text(f"{len(VALUES)}/{len(VALUES)}")
    shown = page.locator("#film .cell .value").all_inner_texts()
    assert [float(each.split()[0]) for each in shown] == pytest.approx(VALUES, abs=0.5)

    Hand(page).save()
    (gauge,) = yaml_of(running.session.target)["gauges"]
    assert (gauge["name"], gauge["unit"]) == ("airspeed", "kt")
    values = Scale.of(tuple(map(tuple, gauge["scale"]))).values_at(np.array(list(SCALE.values())))
    assert values == pytest.approx(list(SCALE), abs=0.5)
    assert logging.getLogger("decoder.setup").isEnabledFor(logging.ERROR)


def test_without_numerals_places_are_proposed(
    start: Start, open_page: OpenPage, airspeed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the extra is not installed, the page says what brings the numerals; anchors and the dial are found."""
    monkeypatch.setattr("decoder.setup.finding.numerals.PACKAGES", ("no_such_package_here",))
    page = open_page(start(airspeed))
    Hand(page).press("d")
    expect(page.locator("#findagain")).to_be_visible(timeout=120_000)
    expect(page.locator("#found .notes")).to_contain_text("pip install 'image-flight-recorder[ocr]'")
    anchors, dial = names(page)
    assert anchors.endswith("anchors")
    assert dial == "dial"
    Hand(page).click((CENTRE[0] + 60, CENTRE[1] + 60))
    centre = [float(page.locator(f'[id="f:gauges[0].centre[{axis}]"]').input_value()) for axis in (0, 1)]
    assert math.dist(centre, CENTRE) < 1.0


@pytest.mark.slow
def test_the_search_leaves_out_what_is_drawn_and_ends_when_nobody_waits(
    airspeed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever else a draft has in its lists."""
    monkeypatch.setattr("decoder.setup.finding.numerals.PACKAGES", ("no_such_package_here",))
    session = SetupSession(open_source([airspeed]), None, tmp_path / "panel.yaml", is_new=True)
    drawn = {"centre": [CENTRE[0] + 9.0, CENTRE[1]], "radius": [40.0, RADIUS_PX]}

    def found(gauges: object, stale: bool = False) -> list[Step]:  # noqa: FBT001, FBT002
        draft = {**session.document, "gauges": gauges}
        return [each for each in search(session, draft, "frame-0", lambda: stale) if isinstance(each, ProposedGauge)]

    assert found([drawn]) == []
    assert len(found([5, {"centre": "x"}, {"window": []}])) == 1
    with pytest.raises(Superseded):
        found([], stale=True)
