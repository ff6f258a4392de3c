"""A gauge's pivot given a panel's other gauges, and the steps to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.learning.pivots import CARELESS_PART, PivotPath, empirical_bayes, lifts_missing
from decoder.panel.arrays import Floats
from decoder.registration.pivot import PRIOR_PX, UNKNOWN, Pivot

HERE = (0.0, 0.0)
REACH_PX = 8.0


def seen(x_px: float, y_px: float, sigma_px: float, moved_px: tuple[float, float] = HERE) -> Pivot:
    """The pivot of a gauge by its needles, with this uncertainty, and with the prior of any panel."""
    covariance = np.eye(2) / (1 / sigma_px**2 + 1 / PRIOR_PX**2)
    x, y = (covariance / sigma_px**2 @ np.subtract((x_px, y_px), moved_px)).tolist()
    return Pivot((x, y), covariance)


def together(*pivots: Pivot) -> tuple[Pivot, ...]:
    """Combine pivots of which none has been moved."""
    return empirical_bayes(pivots, [HERE] * len(pivots), [REACH_PX] * len(pivots))


def sigma_px(pivot: Pivot) -> float:
    """Its standard uncertainty along either axis."""
    return float(np.sqrt(np.trace(pivot.covariance_px2) / 2))


CAREFUL = [seen(x, y, 0.02) for x, y in ((0.01, 0.0), (-0.02, 0.01), (0.0, -0.01), (0.02, 0.02), (-0.01, 0.0))]
CARELESS = [seen(x, y, 0.02) for x, y in ((0.4, 0.1), (-0.3, 0.5), (0.6, -0.2), (-0.1, -0.4), (0.2, 0.3))]


def test_needle_that_stands_still_is_believed_where_the_others_are_drawn_well() -> None:
    """Half a pixel's uncertainty becomes a sixth: one gauge in ten may still be drawn carelessly."""
    *others, still = together(*CAREFUL, UNKNOWN)

    assert 0.1 < sigma_px(still) < 0.2
    assert all(sigma_px(pivot) < 0.02 for pivot in others)


def test_needle_that_stands_still_is_doubted_where_the_others_are_drawn_badly() -> None:
    """There is then no evidence for it, and the others' pivots by their own needles hardly change."""
    *others, still = together(*CARELESS, UNKNOWN)

    assert sigma_px(still) > 0.3
    for pivot, alone in zip(others, CARELESS, strict=True):
        assert pivot.offset_px == pytest.approx(alone.offset_px, abs=0.01)


@given(st.floats(0.0, 6.3), st.floats(0.01, 6.0), st.floats(0.02, 5.0), st.floats(0.02, 5.0))
def test_pivot_that_few_places_tell_goes_no_further_than_they_say(
    way: float, far_px: float, along_px: float, across_px: float
) -> None:
    """Its own uncertainty leaves no unfounded pull, and the panel's care makes it no surer than it was."""
    axis = np.array([np.cos(way), np.sin(way)])
    information = np.outer(axis, axis) / along_px**2 + (np.eye(2) - np.outer(axis, axis)) / across_px**2
    covariance = np.linalg.inv(information + np.eye(2) / PRIOR_PX**2)
    x, y = (covariance @ information @ (far_px * axis)).tolist()

    doubted = Pivot((x, y), covariance).doubted()
    (one,) = empirical_bayes([doubted], [HERE], [REACH_PX])

    assert not doubted.is_certain
    assert np.hypot(*doubted.offset_px) <= np.hypot(x, y) + 1e-6
    assert np.hypot(*one.offset_px) <= far_px + 1e-6
    assert np.hypot(*one.offset_px) <= 2.0 * sigma_px(one) + 1e-6


def test_pivot_that_is_surely_elsewhere_stays_there() -> None:
    """One gauge of a well drawn panel may be drawn badly."""
    odd = together(*CAREFUL, seen(0.7, -0.4, 0.03))[-1]

    assert odd.offset_px == pytest.approx((0.7, -0.4), abs=0.01)
    assert sigma_px(odd) < 0.035


def test_careless_hand_is_known_by_the_others_and_goes_no_further_than_any_hand() -> None:
    """A roughly known pivot is accepted if the others are off too, within what its dial allows."""
    far = [seen(x, y, 0.05) for x, y in ((3.0, 1.0), (-2.0, 4.0), (4.0, -1.0), (-1.0, -3.0))]
    doubtful, alone = together(*far, seen(5.0, 0.0, 1.0))[-1], together(*CAREFUL, seen(5.0, 0.0, 1.0))[-1]
    tiny = empirical_bayes([*far, UNKNOWN], [HERE] * 5, [REACH_PX] * 4 + [1.0])[-1]

    assert 4.0 < doubtful.offset_px[0] < 5.0
    assert alone.offset_px[0] < 2.0
    assert sigma_px(together(*far, UNKNOWN)[-1]) > 2.0
    assert sigma_px(tiny) < 0.6


def test_needle_that_seems_to_turn_where_no_hand_draws_it_tells_nothing() -> None:
    """A runaway returns to the drawn centre."""
    path = PivotPath(far_px=(3.0, 0.0), moved_px=(1.0, 0.0))

    assert path.within_reach(left(2.0, 0.0), REACH_PX) == left(2.0, 0.0)
    assert path.within_reach(left(5.0, 0.0), REACH_PX).covariance_px2 is UNKNOWN.covariance_px2


def test_pivot_that_was_moved_is_held_against_where_it_was_drawn() -> None:
    """The combined estimate does not depend on the point around which the gauge is unwrapped."""
    moved = [(0.3, -0.1), HERE, (0.1, 0.1), HERE, HERE, (-0.2, 0.4)]
    places = [(0.41, 0.1), (-0.29, 0.5), (0.6, -0.2), (-0.1, -0.4), (0.2, 0.3), (0.1, 0.2)]
    stayed = together(*(seen(x, y, 0.1) for x, y in places))
    went = empirical_bayes(
        [seen(x, y, 0.1, shift) for (x, y), shift in zip(places, moved, strict=True)], moved, [REACH_PX] * len(moved)
    )

    for one, other, shift in zip(stayed, went, moved, strict=True):
        assert np.add(other.offset_px, shift) == pytest.approx(one.offset_px, abs=1e-9)
        assert other.covariance_px2 == pytest.approx(one.covariance_px2, abs=1e-12)


@pytest.mark.parametrize("care_px", [0.01, 0.05, 0.3])
def test_doubt_is_what_it_claims(care_px: float) -> None:
    """For panels drawn with some care, except a tenth of the gauges, with pivots that needles show well or badly."""
    rng = np.random.default_rng(7)
    chi2 = []
    for _ in range(80):
        sigmas = rng.choice([0.02, 0.05, 0.3], 8)
        cares = np.where(rng.random(8) < CARELESS_PART, PRIOR_PX, care_px)
        truths = rng.normal(0.0, cares[:, None], (8, 2))
        told = [seen(*(truth + rng.normal(0.0, sigma, 2)), sigma) for truth, sigma in zip(truths, sigmas, strict=True)]
        for pivot, truth in zip(together(*told), truths, strict=True):
            off = np.subtract(pivot.offset_px, truth)
            chi2.append(off @ np.linalg.solve(pivot.covariance_px2, off))

    assert 1.2 < np.mean(chi2) < 2.5  # two degrees of freedom


THERE = np.array([0.4, -0.7])
SURELY = 1e-6 * np.eye(2)
# A needle that turns by thirty degrees to either side of straight up hardly tells how far to the side its pivot lies.
SPREADS_PX = np.array([0.3, 0.06])
BELOW = np.array([0.05, -0.5])


def left(x_px: float, y_px: float, covariance_px2: Floats = SURELY) -> Pivot:
    """Offset by a round's tilts, almost without uncertainty."""
    return Pivot((x_px, y_px), covariance_px2, tilts=16)


def told(path: PivotPath, gain: float) -> Pivot:
    """Offset by tilts on the way: a needle that hardly turns shows its other direction `gain` times as far."""
    return left(*(np.diag([gain, 0.9]) @ (THERE - path.moved_px)).tolist())


def roughly_told(path: PivotPath, gain: float) -> Pivot:
    """Offset by such a needle's tilts; rounding makes it differ when a last bit differs."""
    rough = 0.1 * np.sin(1e7 * np.array(path.moved_px) + (0.0, 1.0)) * SPREADS_PX
    x, y = (np.diag([gain, 0.7]) @ (BELOW - path.moved_px) + rough).tolist()
    return left(x, y, np.diag(SPREADS_PX**2))


@pytest.mark.parametrize("gain", [0.5, 1.0])
def test_last_bits_move_a_pivot_by_less_than_its_doubt(gain: float) -> None:
    """Nor are they followed over rounds, even if steps fall short."""
    ends, settled = [], []
    for bits in range(16):
        path = PivotPath((1e-6 * bits, 0.0))
        for _ in range(7):
            path = path.next(roughly_told(path, gain))
        ends.append(path.moved_px)
        settled.append(path.step_px is None)

    assert all(settled)
    assert (np.ptp(ends, axis=0) < SPREADS_PX).all()
    assert (np.abs(ends - BELOW) < 2 * SPREADS_PX).all()


def test_offset_is_told_where_it_is_more_than_its_doubt() -> None:
    """The same length is significant in the direction that needles show well, and hardly in the other."""
    covariance_px2 = np.diag(SPREADS_PX**2)

    assert left(0.15, 0.0, covariance_px2).shrunk_px == pytest.approx((0.03, 0.0), abs=0.01)
    assert left(0.0, 0.15, covariance_px2).shrunk_px == pytest.approx((0.0, 0.13), abs=0.01)
    assert left(0.0, 0.0, covariance_px2).shrunk_px == pytest.approx((0.0, 0.0))


def test_lift_is_taken_where_it_is_sure_and_then_followed() -> None:
    """A lift that comes and goes with last bits would move dials by tenths of a pixel when the camera moves far."""
    doubted, sure = (Pivot((0.0, 0.0), SURELY, lift=0.011, lift_sigma=sigma) for sigma in (0.006, 0.003))

    assert lifts_missing([0.0, 0.0], [doubted, sure]) == pytest.approx([0.0, 0.0102], abs=1e-4)
    assert lifts_missing([0.02], [doubted]) == pytest.approx([0.0085], abs=1e-4)
