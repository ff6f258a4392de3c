"""Seen faces: marks behind the panel picture's needle are not taken for it, if the flight shows them without it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.flight_tuning import lit_views, unwrapped
from decoder.gauge_grid import row_of_angle
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Reading, Status
from decoder.seen_faces import with_seen_faces

Draw = Callable[..., GreyPicture]
MakeReader = Callable[..., PanelReader]
DIM = {"speed_kt": 75.0}
AT_DEG = 240.0
"""On a bright mark, which the dim needle half covers."""
PANEL_HANDS = {"speed_kt": AT_DEG, "al_lb": 195.0, "fr_lb": 345.0}


def over_a_mark(content: dict[str, Any]) -> None:
    """The panel's needles as they are drawn."""
    for gauge in content["gauges"]:
        for needle in gauge["needles"]:
            needle["template"]["at"] = PANEL_HANDS[needle["name"]]


def angles_of(seed: int) -> dict[str, float]:
    """Needles in random places, those of the fuel gauge well apart."""
    rng = np.random.default_rng(seed)
    return {"speed_kt": rng.uniform(260, 415), "al_lb": rng.uniform(125, 240), "fr_lb": rng.uniform(290, 415)}


@pytest.fixture(scope="module")
def reader(reader_of: MakeReader, draw: Draw) -> PanelReader:
    """Of a panel picture whose dim needle lies over a mark."""
    return reader_of(over_a_mark, panel=draw(PANEL_HANDS, levels=DIM, ticks=True))


@pytest.fixture(scope="module")
def flight(draw: Draw) -> list[GreyPicture]:
    """Frames in which it lies elsewhere."""
    return [draw(angles_of(seed), levels=DIM, noise=2.0, seed=seed, ticks=True) for seed in range(60, 76)]


def window(reader: PanelReader) -> slice:
    """The rows of the speed gauge around where its needle is drawn."""
    middle = round(row_of_angle(reader.grids[0], AT_DEG))
    return slice(middle - 6, middle + 7)


def bared(reader: PanelReader, frames: list[GreyPicture]) -> PanelReader:
    """The reader with what some frames show behind its needles."""
    samples = unwrapped(reader, frames)
    return with_seen_faces(reader, lit_views(reader, samples), reader.found_in(samples))


def test_needle_that_is_read_as_it_moves_is_not_in_doubt(reader: PanelReader, flight: list[GreyPicture]) -> None:
    """Its dial stays as it was thought to be: it is not the marks behind it that match."""
    samples = unwrapped(reader, flight)
    moving = [
        {**found, "speed_kt": Reading(Status.READ, 260.0 + 10.0 * number, 0.1, 0.95)}
        for number, found in enumerate(reader.found_in(samples))
    ]
    dials = with_seen_faces(reader, lit_views(reader, samples), moving).tuning.faces

    assert dials[0] is reader.tuning.faces[0]


def test_what_lies_behind_the_drawn_needle_is_what_frames_show_there(
    reader: PanelReader, flight: list[GreyPicture], draw: Draw
) -> None:
    """The mark comes out, where only the plain dial was known."""
    without = draw({**PANEL_HANDS, "speed_kt": 300.0}, levels=DIM, ticks=True)
    (bare,) = unwrapped(reader, [without])
    seen = bared(reader, flight)
    rows = window(reader)

    assert np.abs(reader.tuning.faces[0][rows] - bare.gauges[0][rows]).max() > 60.0
    assert np.abs(seen.tuning.faces[0][rows] - bare.gauges[0][rows]).max() < 15.0


def test_needle_that_stays_where_it_is_drawn_leaves_the_dial_as_it_was(reader: PanelReader, draw: Draw) -> None:
    """Nothing is known of what lies behind it."""
    still = [draw(PANEL_HANDS, levels=DIM, noise=2.0, seed=seed, ticks=True) for seed in range(8)]

    assert bared(reader, still) is reader


def test_needle_that_stays_in_another_light_leaves_the_dial_as_it_was(reader: PanelReader, draw: Draw) -> None:
    """The sun is no other dial."""
    lit = [draw(PANEL_HANDS, levels=DIM, noise=2.0, seed=seed, ticks=True, gain=0.6, offset=20.0) for seed in range(8)]

    assert bared(reader, lit) is reader


def test_needle_that_moves_a_little_leaves_the_dial_as_it_was(reader: PanelReader, draw: Draw) -> None:
    """It still stands where it would be taken for the dial."""
    near = [
        draw({**PANEL_HANDS, "speed_kt": AT_DEG + 1.5}, levels=DIM, noise=2.0, seed=seed, ticks=True)
        for seed in range(8)
    ]

    assert bared(reader, near) is reader


def test_few_frames_tell_nothing(reader: PanelReader, flight: list[GreyPicture]) -> None:
    """Four of them may show anything there."""
    assert bared(reader, flight[:4]) is reader
