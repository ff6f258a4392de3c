"""Scales: angles to values and back, either way round."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.panel.scale import Scale

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
def test_angle_and_value_lead_to_each_other(scale: Scale, part: float) -> None:
    """The angle of an angle's value is that angle, and the other way round, between marks and beyond them."""
    angle_deg = np.array([scale.angles_deg[0] + part * np.ptp(scale.angles_deg)])
    span = scale.values[-1] - scale.values[0]
    value = np.array([scale.values[0] + part * span])

    assert scale.angles_of(scale.values_at(angle_deg)) == pytest.approx(angle_deg, abs=1e-4)
    assert scale.values_at(scale.angles_of(value)) == pytest.approx(value, abs=1e-7 * abs(span))


@given(scale=scales(), parts=st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2)))
def test_scale_never_turns_back(scale: Scale, parts: tuple[float, float]) -> None:
    """A needle further clockwise never shows less on a rising scale, nor more on a falling one."""
    angles_deg = scale.angles_deg[0] + np.sort(parts) * np.ptp(scale.angles_deg)
    before, after = scale.values_at(angles_deg)

    assert (after - before) * (scale.values[-1] - scale.values[0]) >= 0


@pytest.mark.parametrize(
    ("marks", "angles_deg", "values"),
    [
        ([(120, 0), (150, 60), (250, 80)], [135, 200], [30, 70]),  # between marks on a line, each with its own slope
        ([(120, 0), (150, 60), (250, 80)], [118, 255], [-4, 81]),  # beyond them on that of the outermost two
        ([(100, 50), (200, 0)], [150, 80], [25, 60]),  # values that grow anticlockwise
        ([(300, 0), (420, 120)], [350, 370], [50, 70]),  # past a full turn, not near its start
        ([(0, 0), (10, 1)], [np.nan], [np.nan]),
    ],
)
def test_known_angles_have_known_values(
    marks: list[tuple[float, float]], angles_deg: list[float], values: list[float]
) -> None:
    """By hand."""
    assert Scale.of(marks).values_at(np.array(angles_deg, float)).tolist() == pytest.approx(values, nan_ok=True)
