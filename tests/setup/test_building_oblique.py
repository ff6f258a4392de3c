"""Dials of an oblique panel, drawn with clicks and keys only, read as well as those written with the truth.

The hand is unsteady, and sees only what a person does: the places of marks, needles and labels in one frame.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.sync_api import expect

from fixtures.cockpit.description import panel_yaml
from fixtures.cockpit.flights import FLIGHTS
from fixtures.cockpit.instruments import needle_angle_deg
from fixtures.cockpit.panels import PANELS
from tests.programs import DECODE, ran, write_yaml, yaml_of
from tests.setup.hand import Hand

NAME = "standby_small"
FIXTURES = Path(__file__).parents[2] / "fixtures" / "oblique"
FLIGHT, TRUTH = FIXTURES / f"{NAME}.mcap", FIXTURES / f"{NAME}_truth.csv"
WITHIN_PCT_OF_FULL_SCALE = 0.05
MARKS_WITHIN_DEG, AXES_WITHIN_DEG = 0.6, 0.6
# One whose scale is uneven, and one whose values rise anticlockwise.
DRAWN = ("itt", "oil_press")
# In this frame no needle points at a mark.
FRAME = 16

XY = tuple[float, float]


class Eyes:
    """What somebody sees in a frame of the flight, from what it was rendered with."""

    def __init__(self, frame: int) -> None:
        self.panel = PANELS[FLIGHTS[NAME].panel]
        self.state = FLIGHTS[NAME].states()[frame]

    @cached_property
    def document(self) -> dict[str, Any]:
        """Boxes and places of that frame, of the dials that are drawn."""
        content: dict[str, Any] = yaml.safe_load(panel_yaml(self.panel.name, self.state.view))
        return content | {"gauges": [gauge for gauge in content["gauges"] if gauge["name"] in DRAWN]}

    def place(self, gauge: str, angle_deg: float, part: float, further_px: float = 0.0) -> XY:
        """A place on a dial: a part of the way from its pivot to where its marks end, and some pixels further."""
        case, scale = next((case, scale) for case, scale in self.panel.scales if scale.name == gauge)
        pivot, angle = case.pivot(scale), math.radians(angle_deg)
        centre = self.state.view.project(pivot, case.recess)
        x, y = self.state.view.project(
            (pivot[0] + part * scale.rim * math.cos(angle), pivot[1] + part * scale.rim * math.sin(angle)), case.recess
        )
        longer = 1.0 + further_px / math.dist((x, y), centre)
        return centre[0] + (x - centre[0]) * longer, centre[1] + (y - centre[1]) * longer

    def on_ring(self, gauge: str) -> Callable[[float, float], XY]:
        """Where marks end on a dial."""
        return lambda angle_deg, further_px: self.place(gauge, angle_deg, 1.0, further_px)

    def numbered_marks(self, gauge: dict[str, Any]) -> list[list[float]]:
        """The marks of a dial that have numbers, and those where its divisions change."""
        scale = next(scale for _, scale in self.panel.scales if scale.name == gauge["name"])
        wanted = {value for value, _ in (*scale.numerals, *((value, angle) for angle, value in scale.knots))}
        return [mark for mark in gauge["scale"] if mark[1] in wanted]

    def needles(self, gauge: str) -> list[tuple[str, float]]:
        """The needles of a dial, and where they point."""
        scale = next(scale for _, scale in self.panel.scales if scale.name == gauge)
        return [(each.name, needle_angle_deg(scale, each, self.state.values[each.shows])) for each in scale.needles]


def written(folder: Path) -> Path:
    """The flight's own panel, with no more than the dials that are drawn."""
    shutil.copytree(FIXTURES / NAME, folder)
    panel = yaml_of(folder / "panel.yaml")
    gauges = [gauge for gauge in panel["gauges"] if gauge["name"] in DRAWN]
    return write_yaml(folder / "panel.yaml", panel | {"gauges": gauges})


def decoding(folder: Path, panel: Path) -> subprocess.Popen[bytes]:
    """The flight being decoded with a panel."""
    return subprocess.Popen(
        [DECODE, FLIGHT, "--panel", panel, "-o", folder], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def errors(decoded: subprocess.Popen[bytes], folder: Path) -> dict[str, float]:
    """Mean error of what was read of each needle, in percent of full scale."""
    assert decoded.wait(120) == 0
    done = ran("decode", "accuracy", folder / f"{NAME}.csv", TRUTH, "--json")
    return {row["needle"]: row["by_status"]["read"]["mean_abs_pct_fs"] for row in json.loads(done.stdout)}


def draw(hand: Hand, eyes: Eyes) -> None:
    """Everything that the panel needs."""
    hand.page.locator("#frame").fill(str(FRAME))
    hand.page.locator("#useframe").press("Enter")
    expect(hand.page.locator("#useframe")).to_be_hidden()
    hand.type_into("name", "drawn")
    for index, reference in enumerate(eyes.document["reference_points"]):
        hand.reference(index, reference["at"], reference["inches"])
    for anchor in eyes.document["anchors"]:
        hand.anchor(anchor["name"], anchor["box"])
    hand.level(eyes.document["level"])
    for index, gauge in enumerate(eyes.document["gauges"]):
        first, last = gauge["sweep"]
        marks = {**gauge, "scale": eyes.numbered_marks(gauge)}
        hand.gauge(index, marks, eyes.on_ring(gauge["name"]), rim_deg=(first, (first + last) / 2, last))
        for end, angle_deg in enumerate((first, last)):
            hand.type_into(f"gauges[{index}].sweep[{end}]", f"{angle_deg:g}")
        hand.open("more")
        hand.type_into(f"gauges[{index}].needle_height_inches", str(gauge["needle_height_inches"]))
        for number, (name, angle_deg) in enumerate(eyes.needles(gauge["name"])):
            hand.needle(index, number, eyes.place(gauge["name"], angle_deg, 0.7), name)
        if gauge.get("tail"):
            hand.page.locator(f'[id="f:gauges[{index}].tail"]').check()


OFFERED = "#usepivot, #useheight, #findaxes, #useaxis"
MOST_OFFERS = 5


def take_offers(hand: Hand, gauges: list[str]) -> list[str]:
    """Takes the offers for each needle's pivot, then for its axis; returns them."""
    taken, page = [], hand.page
    tried = page.locator("#outline .of-gauge .count").filter(has_text=re.compile(r"^20/20$"))
    for name in gauges:
        expect(tried).to_have_count(len(gauges))
        page.locator("#outline li button", has_text=name).click()
        for _ in range(MOST_OFFERS):
            expect(tried).to_have_count(len(gauges))
            expect(page.locator("#film")).to_have_attribute("aria-label", re.compile(rf"^{name} in 20 frames"))
            expect(page.locator("#inspector h2")).to_have_text(name)
            hand.look()  # what is offered is drawn after the filmstrip
            expect(page.locator("#advising")).to_have_count(0)
            if not page.locator(OFFERED).count():
                break
            taken.append(f"{name}: {page.locator('#inspector .offer').first.inner_text()}")
            page.locator(OFFERED).click()
            expect(page.locator(OFFERED)).to_have_count(0)
        else:
            pytest.fail(f"what is offered of {name} comes to no end: {taken}")
    return taken


@pytest.mark.slow
@pytest.mark.untraced
def test_oblique_dials_drawn_by_hand_read_like_the_written_ones(
    start: Callable[..., Any], open_page: Callable[..., Any], tmp_path: Path
) -> None:
    """Two dials of an oblique flight, from nothing, are within 0.05 % of full scale of the written panel."""
    known = decoding(tmp_path / "known", written(tmp_path / "written"))
    running, eyes = start(FLIGHT), Eyes(FRAME)
    hand = Hand(open_page(running))
    draw(hand, eyes)
    taken = take_offers(hand, [gauge["name"] for gauge in eyes.document["gauges"]])
    hand.save()
    saved = yaml_of(running.session.target)["gauges"]
    drawn = errors(decoding(tmp_path / "drawn", running.session.target), tmp_path / "drawn")
    best = errors(known, tmp_path / "known")
    for gauge, wanted in zip(saved, eyes.document["gauges"], strict=True):
        assert gauge["sweep"] == pytest.approx(wanted["sweep"], abs=0.5)
        marks = sorted(eyes.numbered_marks(wanted))
        assert [mark[1] for mark in gauge["scale"]] == [value for _, value in marks]
        assert [mark[0] for mark in gauge["scale"]] == pytest.approx(
            [angle for angle, _ in marks], abs=MARKS_WITHIN_DEG
        )
        for needle, (_, angle_deg) in zip(gauge["needles"], eyes.needles(gauge["name"]), strict=True):
            off_deg = (needle["template"]["at"] - angle_deg + 180.0) % 360.0 - 180.0
            assert off_deg == pytest.approx(0.0, abs=AXES_WITHIN_DEG)
    assert list(drawn) == [needle["name"] for gauge in eyes.document["gauges"] for needle in gauge["needles"]]
    assert {
        name: drawn[name] - best[name] for name in drawn if drawn[name] - best[name] > WITHIN_PCT_OF_FULL_SCALE
    } == {}, (taken, saved)
