"""Scales: angles to values and back, either way round."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.scale import Scale

GAPS = st.lists(st.floats(1.0, 60.0), min_size=2, max_size=10)


@st.composite
def scales(draw: st.DrawFn) -> Scale:
    """Any monotone scale, its values rising or falling clockwise."""
    turns = draw(GAPS)
    steps = draw(st.lists(st.floats(0.1, 5000.0), min_size=len(turns), max_size=len(turns)))
    sign = draw(st.sampled_from([1.0, -1.0]))
    angles = accumulate(turns, initial=draw(st.floats(-180.0, 360.0)))
    values = accumulate(steps, initial=draw(st.floats(-1000.0, 1000.0)))
    return Scale.of([(angle, sign * value) for angle, value in zip(angles, values, strict=True)])


@given(scale=scales(), part=st.floats(-0.2, 1.2))
def test_angle_survives_the_way_to_a_value_and_back(scale: Scale, part: float) -> None:
    """The angle of an angle's value is that angle, between marks and beyond them."""
    angle_deg = np.array([scale.angles_deg[0] + part * np.ptp(scale.angles_deg)])

    assert scale.angles_of(scale.values_at(angle_deg)) == pytest.approx(angle_deg, abs=1e-4)


@given(scale=scales(), part=st.floats(-0.2, 1.2))
def test_value_survives_the_way_to_an_angle_and_back(scale: Scale, part: float) -> None:
    """The value at a value's angle is that value, between marks and beyond them."""
    span = scale.values[-1] - scale.values[0]
    value = np.array([scale.values[0] + part * span])

    assert scale.values_at(scale.angles_of(value)) == pytest.approx(value, abs=1e-7 * abs(span))


@given(scale=scales())
def test_marks_have_exactly_their_values(scale: Scale) -> None:
    """At every tick mark the value is the mark's own."""
    assert scale.values_at(scale.angles_deg) == pytest.approx(scale.values, rel=1e-9, abs=1e-6)


@given(scale=scales(), parts=st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2)))
def test_scale_never_turns_back(scale: Scale, parts: tuple[float, float]) -> None:
    """A needle further clockwise never shows less on a rising scale, nor more on a falling one."""
    angles_deg = scale.angles_deg[0] + np.sort(parts) * np.ptp(scale.angles_deg)
    before, after = scale.values_at(angles_deg)

    assert (after - before) * (scale.values[-1] - scale.values[0]) >= 0


@given(scale=scales(), part=st.floats(0.0, 1.0))
def test_slope_is_that_of_the_part_of_the_scale(scale: Scale, part: float) -> None:
    """The slope times a small turn is the change of the value, with its sign."""
    angle_deg = np.array([scale.angles_deg[0] + part * np.ptp(scale.angles_deg)])
    turned = angle_deg - 1e-4
    same_part = np.searchsorted(scale.angles_deg, angle_deg) == np.searchsorted(scale.angles_deg, turned)

    change = scale.values_at(angle_deg) - scale.values_at(turned)

    if same_part.all():
        assert change / 1e-4 == pytest.approx(scale.slopes_at(angle_deg), rel=1e-2)


def test_between_marks_the_value_is_interpolated_linearly() -> None:
    """On a non-linear scale each interval has its own slope."""
    scale = Scale.of([(120, 0), (150, 60), (250, 80)])

    assert scale.values_at(np.array([135.0, 200.0])).tolist() == [30.0, 70.0]


def test_beyond_the_marks_the_outermost_interval_goes_on() -> None:
    """A needle past the last tick is extrapolated along the last two, before the first along the first two."""
    scale = Scale.of([(120, 0), (150, 60), (250, 80)])

    assert scale.values_at(np.array([118.0, 255.0])).tolist() == [-4.0, 81.0]


def test_anticlockwise_scale_falls_with_the_angle() -> None:
    """Where values grow anticlockwise, a clockwise turn lowers the value and the slope is negative."""
    scale = Scale.of([(100, 50), (200, 0)])

    assert scale.values_at(np.array([150.0])).tolist() == [25.0]
    assert scale.slopes_at(np.array([150.0])).tolist() == [-0.5]
    assert scale.angles_of(np.array([25.0, 60.0])).tolist() == [150.0, 80.0]


def test_scale_runs_on_past_a_full_turn() -> None:
    """Angles past 360 are places further along the scale, not places near its start."""
    scale = Scale.of([(300, 0), (420, 120)])

    assert scale.values_at(np.array([350.0, 370.0])).tolist() == [50.0, 70.0]


def test_no_angle_has_no_value() -> None:
    """NaN stays NaN."""
    scale = Scale.of([(0, 0), (10, 1)])

    assert np.isnan(scale.values_at(np.array([np.nan]))).all()
