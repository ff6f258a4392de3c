"""A panel built from nothing with clicks and keys reads as well as one that was written with the truth at hand."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.sync_api import expect

from decoder.method import Method
from decoder.panel_pictures import panel_from_file
from decoder.panel_reader import PanelReader
from decoder.pictures import grey_picture
from flight_file.reader import open_flight

FIXTURES = Path(__file__).parents[2] / "fixtures"
A1, TRUTH = FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a1_truth.csv"
DECODE = Path(sys.executable).parent / "decode"
# The tick marks of the rendered dials end here.
RING_PX = 51.0
WITHIN_PCT_OF_FULL_SCALE = 0.05


@pytest.fixture
def written() -> dict[str, Any]:
    """The panel that was written by hand, with the renderer's own numbers."""
    panel: dict[str, Any] = yaml.safe_load((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))
    return panel


def where_needles_point() -> dict[str, float]:
    """The needles' angles in the flight's first frame, for somebody who can see them."""
    frame = next(open_flight([A1]).frames())
    read = PanelReader.from_panel(panel_from_file(FIXTURES / "panel.yaml"), Method.NORMXCORR).read(
        grey_picture(frame.jpeg)
    )
    return {name: reading.angle_deg for name, reading in read.readings.items()}


def ring_of(centre: tuple[float, float], angle_deg: float, further_px: float) -> tuple[float, float]:
    """A place on or beside the ring where a dial's marks end."""
    angle, radius_px = math.radians(angle_deg), RING_PX + further_px
    return centre[0] + radius_px * math.cos(angle), centre[1] + radius_px * math.sin(angle)


def decoding(panel: Path, folder: Path) -> subprocess.Popen[bytes]:
    """The flight being decoded with a panel."""
    command = [DECODE, A1, "--panel", panel, "-o", folder]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def errors(decoded: subprocess.Popen[bytes], folder: Path) -> dict[str, float]:
    """Mean error of each needle in percent of full scale."""
    assert decoded.wait(120) == 0
    done = subprocess.run(
        [str(DECODE), "accuracy", str(folder / "thesis_a1.csv"), str(TRUTH), "--json"], check=True, capture_output=True
    )
    return {row["needle"]: row["by_status"]["all"]["mean_abs_pct_fs"] for row in json.loads(done.stdout)}


@pytest.mark.slow
def test_panel_drawn_by_hand_reads_like_the_written_one(
    start: Callable[..., Any],
    open_page: Callable[..., Any],
    hand_on: Callable[..., Any],
    written: dict[str, Any],
    tmp_path: Path,
) -> None:
    """All seven needles of a fixture flight, from nothing, are within 0.05 % of full scale of the written panel's."""
    by_hand = decoding(FIXTURES / "panel.yaml", tmp_path / "written")
    running = start()
    hand = hand_on(open_page(running))
    angles = where_needles_point()

    hand.type_into("name", written["name"])
    for anchor in written["anchors"]:
        hand.anchor(anchor["name"], anchor["box"])
    hand.level(written["level"])
    for index, gauge in enumerate(written["gauges"]):
        on_ring = partial(ring_of, gauge["centre"])
        hand.gauge(index, gauge, on_ring)
        for number, needle in enumerate(gauge["needles"]):
            hand.needle(index, number, on_ring(angles[needle["name"]], 40.0 - RING_PX), needle["name"])
        for number, needle in enumerate(gauge["needles"]):
            if "covered_by" in needle:
                field = hand.page.locator(f'[id="f:gauges[{index}].needles[{number}].covered_by"]')
                field.select_option(needle["covered_by"])
    expect(hand.page.locator("#outline .dot.good")).to_have_count(6)
    hand.save()

    drawn = errors(decoding(running.session.target, tmp_path / "drawn"), tmp_path / "drawn")
    best = errors(by_hand, tmp_path / "written")
    assert list(drawn) == list(best)
    assert {
        name: drawn[name] - best[name] for name in best if drawn[name] - best[name] > WITHIN_PCT_OF_FULL_SCALE
    } == {}
