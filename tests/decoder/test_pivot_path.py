"""Steps to where needles turn, where each step changes what the needles seem to tell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decoder.arrays import Floats
from decoder.pivot_path import FARTHEST, PivotPath
from decoder.pivot_rounds import further, is_off, lifts_missing
from decoder.pivots import Pivot

THERE = np.array([0.4, -0.7])
SURELY = 1e-6 * np.eye(2)
# A needle that turns by thirty degrees to either side of straight up hardly tells how far to the side its pivot lies.
SPREADS_PX = np.array([0.3, 0.06])
BELOW = np.array([0.05, -0.5])


def left(x_px: float, y_px: float, covariance_px2: Floats = SURELY) -> Pivot:
    """What tilts tell in a round, almost without doubt."""
    return Pivot((x_px, y_px), covariance_px2, tilts=16)


def told(path: PivotPath, gain: float) -> Pivot:
    """What tilts tell along the way: a needle that hardly turns tells its other direction `gain` times as far."""
    return left(*(np.diag([gain, 0.9]) @ (THERE - path.moved_px)).tolist())


@pytest.mark.parametrize("gain", [0.3, 0.8, 1.6, 2.5])
def test_path_ends_where_needles_turn(gain: float) -> None:
    """Steps that would fall short, swing to and fro or run away come to it all the same, in five."""
    path = PivotPath()
    for _ in range(5):
        path = path.on(told(path, gain))

    assert path.was_moved
    assert not is_off(told(path, gain), was_moved=True)


def test_path_that_would_run_away_turns_back_unless_the_others_went_there() -> None:
    """What is left grew along the first step: where the other gauges are as drawn, that step was wrong."""
    path = PivotPath().on(left(0.1, 0.0))
    back = path.on(left(0.2, 0.0))
    on = path.on(left(0.2, 0.0), (1.0, 0.1))

    assert back.moved_px == pytest.approx((0.0, 0.0), abs=1e-3)
    assert on.moved_px == pytest.approx((0.3, 0.0), abs=1e-3)


def test_lost_gauge_goes_where_the_others_are() -> None:
    """Its own needles are not seen any more from where it was moved to."""
    path = PivotPath().on(left(0.5, 0.5)).to((-2.0, 1.0))

    assert path.moved_px == (-2.0, 1.0)
    assert path.step_px == pytest.approx((-2.5, 0.5), abs=1e-5)


def test_first_step_goes_where_tilts_point() -> None:
    """There is nothing to learn from yet; the same after a rest."""
    path = PivotPath().on(left(0.3, -0.2))

    assert path.moved_px == path.step_px == pytest.approx((0.3, -0.2), abs=1e-5)
    assert path.stay().on(left(0.1, 0.1)).step_px == pytest.approx((0.1, 0.1), abs=1e-5)


def test_path_that_stays_is_where_it_was() -> None:
    """A rest is no step, and the path still says that the pivot was moved."""
    path = PivotPath().on(left(0.3, -0.2)).stay()

    assert path.moved_px == pytest.approx((0.3, -0.2), abs=1e-5)
    assert (path.step_px, path.was_moved) == (None, True)
    assert not PivotPath().stay().was_moved


def test_step_that_changed_nothing_sends_nobody_far() -> None:
    """Two places that tell nearly the same are no base for a third far away."""
    path = PivotPath().on(left(0.3, 0.0)).on(left(0.29999, 0.0))

    assert path.step_px is not None
    assert math.hypot(*path.step_px) <= FARTHEST * 0.3
    assert PivotPath().on(left(0.3, 0.0)).on(left(0.3, 0.0)).step_px == pytest.approx((0.3, 0.0), abs=1e-5)


def roughly_told(path: PivotPath, gain: float) -> Pivot:
    """What tilts of such a needle tell; as places and readings are rounded, not quite the same a last bit beside."""
    rough = 0.1 * np.sin(1e7 * np.array(path.moved_px) + (0.0, 1.0)) * SPREADS_PX
    x, y = (np.diag([gain, 0.7]) @ (BELOW - path.moved_px) + rough).tolist()
    return left(x, y, np.diag(SPREADS_PX**2))


@pytest.mark.parametrize("gain", [-0.5, 0.3, 1.0, 2.2])
def test_last_bits_move_a_pivot_by_less_than_its_doubt(gain: float) -> None:
    """Nor are they followed for rounds, even where a step to where tilts point makes more of what is left."""
    ends, settled = [], []
    for bits in range(16):
        paths = [PivotPath((1e-6 * bits, 0.0))]
        for _ in range(7):
            paths = further(paths, [roughly_told(paths[0], gain)])
        ends.append(paths[0].moved_px)
        settled.append(paths[0].step_px is None)

    assert all(settled)
    assert (np.ptp(ends, axis=0) < SPREADS_PX).all()
    assert (np.abs(ends - BELOW) < 2 * SPREADS_PX).all()


def test_offset_is_told_where_it_is_more_than_its_doubt() -> None:
    """The same length says something in the direction that needles tell, and little in the other."""
    covariance_px2 = np.diag(SPREADS_PX**2)

    assert left(0.15, 0.0, covariance_px2).told_px == pytest.approx((0.03, 0.0), abs=0.01)
    assert left(0.0, 0.15, covariance_px2).told_px == pytest.approx((0.0, 0.13), abs=0.01)
    assert left(0.0, 0.0, covariance_px2).told_px == pytest.approx((0.0, 0.0))


def test_lift_is_taken_where_it_is_sure_and_then_followed() -> None:
    """A lift that comes and goes with last bits moves dials by tenths of a pixel where the camera moves far."""
    doubted, sure = (Pivot((0.0, 0.0), SURELY, lift=0.011, lift_sigma=sigma) for sigma in (0.006, 0.003))

    assert lifts_missing([0.0, 0.0], [doubted, sure]) == pytest.approx([0.0, 0.0102], abs=1e-4)
    assert lifts_missing([0.02], [doubted]) == pytest.approx([0.0085], abs=1e-4)
