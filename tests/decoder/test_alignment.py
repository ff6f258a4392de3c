"""Alignments: a shift and a roll between panel picture and frame."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.alignment import IDENTITY, Alignment

POINTS = st.tuples(st.floats(0, 1000), st.floats(0, 1000))
ROLLS = st.floats(-20, 20)


@given(point=POINTS)
def test_identity_moves_nothing(point: tuple[float, float]) -> None:
    """The identity carries every point to itself."""
    assert IDENTITY.to_frame(point) == pytest.approx(point, abs=1e-4)


@given(panel=POINTS, frame=POINTS, roll_deg=ROLLS)
def test_pinned_point_goes_where_it_is_pinned(
    panel: tuple[float, float], frame: tuple[float, float], roll_deg: float
) -> None:
    """Whatever the roll, the pinned point of the panel lies on its place in the frame."""
    alignment = Alignment.pinned(panel, frame, roll_deg, 0.9)

    assert alignment.to_frame(panel) == pytest.approx(frame, abs=1e-3)
    assert (alignment.roll_deg, alignment.score) == pytest.approx((roll_deg, 0.9))


def test_positive_roll_turns_clockwise_on_the_screen() -> None:
    """With y down, a quarter turn carries right to down and down to left."""
    quarter = Alignment.pinned((100.0, 100.0), (100.0, 100.0), 90.0, 1.0)

    assert quarter.to_frame((110.0, 100.0)) == pytest.approx((100.0, 110.0), abs=1e-4)
    assert quarter.to_frame((100.0, 110.0)) == pytest.approx((90.0, 100.0), abs=1e-4)


@given(pin=POINTS, other=POINTS, roll_deg=ROLLS)
def test_distances_are_kept(pin: tuple[float, float], other: tuple[float, float], roll_deg: float) -> None:
    """Shift and roll change no distance."""
    alignment = Alignment.pinned(pin, (40.0, 30.0), roll_deg, 1.0)
    (x0, y0), (x1, y1) = alignment.to_frame(pin), alignment.to_frame(other)

    before = ((pin[0] - other[0]) ** 2 + (pin[1] - other[1]) ** 2) ** 0.5

    assert ((x0 - x1) ** 2 + (y0 - y1) ** 2) ** 0.5 == pytest.approx(before, abs=2e-3)
