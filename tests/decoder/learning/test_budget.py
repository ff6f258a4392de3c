"""Uncertainty budgets: the causes of a quantity's sigma, over its values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.learning.budget import Budget, Cause, budgets
from decoder.panel.arrays import Floats
from decoder.panel.scale import Combination, Quantity, Scale

MARKS = ((20.0, 0.0), (110.0, 50.0), (200.0, 200.0))


def quantity(name: str, marks: tuple[tuple[float, float], ...], wraps: float | None = None) -> Quantity:
    """A drawn quantity."""
    return Quantity(name, "dial", "ft", marks, wraps, None, None)


def parts_deg(_: str, angles_deg: Floats) -> dict[Cause, Floats]:
    """A scale drawn to a degree, and a pivot beside the centre."""
    even = np.zeros_like(angles_deg)
    around = 2.0 * np.abs(np.sin(np.radians(angles_deg)))
    return {Cause.DRAWN: even + 1.0, Cause.PIVOT: around, Cause.VIEWED: even, Cause.PLACED: even}


def budget_of(name: str, quantities: list[Quantity], combinations: list[Combination]) -> Budget:
    """One of several quantities'."""
    return budgets(quantities, combinations, parts_deg)[name]


def test_a_degree_counts_by_how_much_the_scale_shows_there() -> None:
    """Where marks stand closer together the same angle is more."""
    own = budget_of("speed", [quantity("speed", MARKS)], [])

    assert own.at(10.0)[Cause.DRAWN] == pytest.approx(50.0 / 90.0)
    assert own.at(150.0)[Cause.DRAWN] == pytest.approx(150.0 / 90.0)
    assert own.at(1000.0) == own.at(200.0)


@given(st.floats(-0.9, 0.9), st.sampled_from([None, 300.0]), st.booleans())
def test_a_degree_counts_as_much_beside_a_mark_as_it_does_in_the_value(
    part: float,
    wraps: float | None,
    falls: bool,  # noqa: FBT001
) -> None:
    """It counts more where the interval reaches over a mark to a steeper part, whichever way the scale runs."""
    marks = ((20.0, 200.0), (40.0, 33.0), (200.0, 0.0)) if falls else ((20.0, 0.0), (180.0, 167.0), (200.0, 200.0))
    scale = Scale.of(marks, wraps)
    reach_deg = 1.96 * float(np.linalg.norm(list(parts_deg("speed", np.array(marks[1][0])).values())))
    angle_deg = np.array([marks[1][0] + part * reach_deg])
    parts = parts_deg("speed", angle_deg)
    whole = np.sqrt(np.sum([np.square(each) for each in parts.values()], axis=0))

    own = budget_of("speed", [quantity("speed", marks, wraps)], []).at(float(scale.values_at(angle_deg)[0]))

    worth = float(scale.steepest_at(angle_deg, whole)[0]) * parts[Cause.DRAWN][0]
    assert own[Cause.DRAWN] == pytest.approx(worth, rel=0.25)


@given(st.floats(0.0, 99_999.0))
def test_a_combined_value_has_its_finest_pointers(value: float) -> None:
    """At thousands of feet, or in any turn, the hundreds' hand has the same place as in the first."""
    finest = quantity("hundreds", ((0.0, 0.0), (180.0, 500.0)), 1000.0)
    coarse = quantity("thousands", ((0.0, 0.0), (180.0, 5000.0)), 10_000.0)
    together = Combination(quantity("altitude", coarse.marks, 100_000.0), ("hundreds", "thousands"), 10_000.0, 0.2)

    own = budget_of("altitude", [finest, coarse], [together]).at(value)

    assert own[Cause.DRAWN] == pytest.approx(1000.0 / 360.0)
    there = 2.0 * abs(np.sin(2 * np.pi * value / 1000.0)) * 1000.0 / 360.0
    assert own[Cause.PIVOT] == pytest.approx(there, abs=0.4)
