"""The level edge: its direction gives the roll."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from decoder.alignment import Alignment
from decoder.features import Feature, level_feature
from decoder.level import LevelFinder
from decoder.pictures import GreyPicture

EDGE = ((330.0, 20.0), (330.0, 200.0))
PIVOT = (159.5, 31.5)
HANDS = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
Draw = Callable[..., GreyPicture]


@pytest.fixture(scope="module")
def level(draw: Draw) -> Feature:
    """The drawn edge."""
    return level_feature(draw(HANDS), EDGE)


@pytest.mark.parametrize("roll_deg", [-6.0, -0.5, 0.0, 0.3, 2.0, 7.5])
def test_roll_is_found_to_a_pixel_at_the_far_end(level: Feature, draw: Draw, roll_deg: float) -> None:
    """Rolls up to eight degrees are found from the known point, to one step of the search."""
    there = Alignment.rigid(roll_deg, (0.0, 0.0), 1.0).to_frame(PIVOT)
    found = LevelFinder(level, PIVOT).find(draw(HANDS, roll_deg=roll_deg), there, 0.0)

    assert found == pytest.approx(roll_deg, abs=0.3)


def test_search_starts_at_the_usual_roll(level: Feature, draw: Draw) -> None:
    """A camera that hangs at twelve degrees is found when that is what is usual."""
    there = Alignment.rigid(12.0, (60.0, -20.0), 1.0).to_frame(PIVOT)
    frame = draw(HANDS, roll_deg=12.0, shift_px=(60.0, -20.0))

    assert LevelFinder(level, PIVOT).find(frame, there, 11.8) == pytest.approx(12.0, abs=0.3)


def test_edge_matches_itself(level: Feature, draw: Draw) -> None:
    """In the panel picture the edge scores 1, whatever the light."""
    identity = Alignment.rigid(0.0, (0.0, 0.0), 1.0)

    same, darker = draw(HANDS), draw(HANDS, gain=0.5, offset=40.0)

    assert level.score(same, identity) == pytest.approx(1.0, abs=1e-5)
    assert level.score(darker, identity) > 0.999


@pytest.mark.parametrize("grey", [0, 200])
def test_flat_frame_scores_zero(level: Feature, grey: int) -> None:
    """Where there is no edge, the edge scores 0."""
    flat = np.full((220, 360), grey, np.uint8)

    identity = Alignment.rigid(0.0, (0.0, 0.0), 1.0)

    assert level.score(flat, identity) == 0.0


def test_edge_of_any_direction_can_be_level(draw: Draw) -> None:
    """The edge's samples lie along it and across it, in whichever direction it runs."""
    feature = level_feature(draw(HANDS), ((40.0, 20.0), (120.0, 80.0)))
    x, y = feature.points
    along = ((x - 40) * 80 + (y - 20) * 60) / 100
    across = ((y - 20) * 80 - (x - 40) * 60) / 100

    assert (along.min(), along.max()) == pytest.approx((0.0, 100.0), abs=1e-3)
    assert (across.min(), across.max()) == pytest.approx((-6.0, 6.0), abs=1e-3)
