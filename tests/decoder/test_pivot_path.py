"""Steps to where needles turn, where each step changes what the needles seem to tell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decoder.pivot_path import FARTHEST, PivotPath

THERE = np.array([0.4, -0.7])


def told_px(path: PivotPath, gain: float) -> tuple[float, float]:
    """What tilts tell along the way: a needle that hardly turns tells its other direction `gain` times as far."""
    x, y = (np.diag([gain, 0.9]) @ (THERE - path.moved_px)).tolist()
    return x, y


@pytest.mark.parametrize("gain", [0.3, 0.8, 1.6, 2.5])
def test_path_ends_where_needles_turn(gain: float) -> None:
    """Steps that would fall short, swing to and fro or run away come to it all the same, in five."""
    path = PivotPath()
    for _ in range(5):
        path = path.on(told_px(path, gain))

    assert path.was_moved
    assert np.hypot(*told_px(path, gain)) < 0.03  # SETTLED_PX of the fit


def test_path_that_would_run_away_turns_back_unless_the_others_went_there() -> None:
    """What is left grew along the first step: where the other gauges are as drawn, that step was wrong."""
    path = PivotPath().on((0.1, 0.0))
    back = path.on((0.2, 0.0))
    on = path.on((0.2, 0.0), (1.0, 0.1))

    assert back.moved_px == pytest.approx((0.0, 0.0))
    assert on.moved_px == pytest.approx((0.3, 0.0))


def test_lost_gauge_goes_where_the_others_are() -> None:
    """Its own needles are not seen any more from where it was moved to."""
    path = PivotPath().on((0.5, 0.5)).to((-2.0, 1.0))

    assert path.moved_px == (-2.0, 1.0)
    assert path.step_px == (-2.5, 0.5)


def test_first_step_goes_where_tilts_point() -> None:
    """There is nothing to learn from yet; the same after a rest."""
    path = PivotPath().on((0.3, -0.2))

    assert (path.moved_px, path.step_px) == ((0.3, -0.2), (0.3, -0.2))
    assert path.stay().on((0.1, 0.1)).step_px == (0.1, 0.1)


def test_path_that_stays_is_where_it_was() -> None:
    """A rest is no step, and the path still says that the pivot was moved."""
    path = PivotPath().on((0.3, -0.2)).stay()

    assert (path.moved_px, path.step_px, path.was_moved) == ((0.3, -0.2), None, True)
    assert not PivotPath().stay().was_moved


def test_step_that_changed_nothing_sends_nobody_far() -> None:
    """Two places that tell nearly the same are no base for a third far away."""
    path = PivotPath().on((0.3, 0.0)).on((0.29999, 0.0))

    assert path.step_px is not None
    assert math.hypot(*path.step_px) <= FARTHEST * 0.3
    assert PivotPath().on((0.3, 0.0)).on((0.3, 0.0)).step_px == (0.3, 0.0)
