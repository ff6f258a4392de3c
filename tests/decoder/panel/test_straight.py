"""Windows along something straight: what is half way along it is found there, however narrow it is and clicked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decoder.panel.arrays import Floats
from decoder.panel.kinds.straight import Corners, bow_per_px, places_px
from decoder.panel.thresholds import CONFIDENCE_SIGMAS

LONG_PX = 200.0
HANDS = 200
CLICKED_PX = 0.5


def corners(wide_px: float, wider: float = 1.0) -> Floats:
    """(4, 2): a window that goes down, whose lower end looks so many times as wide as its upper one."""
    half, lower = wide_px / 2, wider * wide_px / 2
    return np.array([[50 - half, 20.0], [50 + half, 20.0], [50 + lower, 20 + LONG_PX], [50 - lower, 20 + LONG_PX]])


def clicked(exact: Floats, hand: int) -> Corners:
    """The same by a hand that is half a pixel off at each corner."""
    off_px = np.random.default_rng(hand).normal(0.0, CLICKED_PX, exact.shape)
    one, two, three, four = ((float(x), float(y)) for x, y in exact + off_px)
    return one, two, three, four


def half_way(drawn: Corners, there: tuple[float, float] = (50.0, 120.0)) -> float:
    """By which part of the length a place lies beyond the middle between both ends."""
    first, at, last = (places_px("down", drawn, place)[0] for place in ((50.0, 20.0), there, (50.0, 220.0)))
    return (at - first) / (last - first) - 0.5


@pytest.mark.parametrize("wide_px", [7.0, 15.0])
def test_clicks_at_the_corners_of_a_narrow_window_do_not_bend_its_scale(wide_px: float) -> None:
    """Half a pixel at each, in a window seven pixels wide, had shifted its middle by a twenty-fifth of its length."""
    off = np.array([half_way(clicked(corners(wide_px), hand)) for hand in range(HANDS)])

    assert math.sqrt(np.square(off).mean()) < 0.007


@pytest.mark.parametrize("wide_px", [7.0, 15.0, 40.0])
def test_what_clicks_may_bend_is_doubted_by_as_much(wide_px: float) -> None:
    """In a view that makes one end larger by a twentieth or less, 95 % of what is half way lies where it is said to."""
    off_px, doubt_px = [], []
    for hand in range(HANDS):
        wider = math.exp(np.random.default_rng(1000 + hand).normal(0.0, 0.05))
        seen_middle = 20.0 + LONG_PX * wider**-1.0 / (1.0 + wider**-1.0)
        drawn = clicked(corners(wide_px, wider), hand)
        off_px.append(LONG_PX * half_way(drawn, (50.0, seen_middle)))
        doubt_px.append(bow_per_px("down", drawn) * (LONG_PX / 2) ** 2)
    within = np.abs(off_px) <= CONFIDENCE_SIGMAS * np.array(doubt_px)

    assert 0.9 < within.mean() < 0.99


def test_a_wide_window_that_is_seen_from_the_side_keeps_its_perspective() -> None:
    """Ends that differ by more than clicks are as far away as they look: half way appears nearer to the smaller end."""
    (one, two, three, four) = ((float(x), float(y)) for x, y in corners(60.0, 1.3))
    middle = 20.0 + LONG_PX / 2.3

    assert places_px("down", (one, two, three, four), (50.0, middle))[0] == pytest.approx(LONG_PX / 2, abs=1.5)
