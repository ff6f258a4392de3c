"""Scales: angles to values and back, either way round; and where hands of one value point."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.kinds.dials.geared import gearing_of
from decoder.panel.gauge import Gauge
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


@given(scale=scales(), part=st.floats(-0.2, 1.2), sigma_deg=st.floats(0.01, 20.0))
def test_interval_holds_all_values_that_the_angles_interval_has(scale: Scale, part: float, sigma_deg: float) -> None:
    """However uneven the marks, a value's 95 % interval covers its angle's, by the longer side."""
    angle_deg = np.array([scale.angles_deg[0] + part * np.ptp(scale.angles_deg)])
    reach_deg = 1.96 * sigma_deg * np.array([-1.0, 0.0, 1.0])
    low, value, high = scale.values_at(angle_deg + reach_deg)
    further = max(abs(low - value), abs(high - value))

    sigma = scale.steepest_at(angle_deg, np.array([sigma_deg])) * sigma_deg

    assert 1.96 * sigma == pytest.approx(further, rel=1e-6, abs=1e-9)


def test_interval_goes_on_through_the_seam_of_a_full_turn() -> None:
    """Next to north a compass is as certain as elsewhere, and steeper marks beyond the seam count."""
    even, uneven = Scale.of([(-90, 0), (90, 180)], 360.0), Scale.of([(0, 0), (90, 180)], 360.0)
    north_deg, sigma_deg = np.array([-90.01, -90.0, 269.9]), np.full(3, 5.0)

    assert even.steepest_at(north_deg, sigma_deg) == pytest.approx(1.0)
    assert uneven.steepest_at(np.array([359.0, -1.0, 350.0]), np.array([0.1, 5.0, 5.0])) == pytest.approx(
        [180 / 270, (8.8 * 2 + 180 / 270) / 9.8, 180 / 270], rel=1e-6
    )


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
    """Values computed by hand."""
    assert Scale.of(marks).values_at(np.array(angles_deg, float)).tolist() == pytest.approx(values, nan_ok=True)


ALTIMETER = Gauge.model_validate(
    {
        "name": "altimeter",
        "centre": [100.0, 100.0],
        "radius": [20, 60],
        "sweep": [270, 630],
        "scale": [[270, 0], [450, 500]],
        "wraps": 1000,
        "combined": {"name": "altitude_ft", "needles": ["hundreds_ft", "thousands_ft"], "lowest": -500},
        "needles": [
            {
                "name": "thousands_ft",
                "template": {"at": 300, "span": 20},
                "scale": [[270, 0], [450, 5000]],
                "wraps": 10000,
            },
            {"name": "hundreds_ft", "template": {"at": 400, "span": 20}},
        ],
    }
)


@given(value=st.floats(-500.0, 9499.0), off_deg=st.floats(-7.0, 7.0))
def test_value_is_told_by_where_its_hands_point(value: float, off_deg: float) -> None:
    """The coarse hand counts and the finest measures: it may be off by up to a fifth of the finest one's turn."""
    gearing = gearing_of(ALTIMETER)
    angles_deg = np.array([float(gearing.angles_deg(hand, np.array([value]))[0]) for hand in (0, 1)])
    angles_deg[1] += off_deg
    told = gearing.counted(angles_deg)

    assert told == pytest.approx(value, abs=1e-6) or told == pytest.approx(value + 10_000.0, abs=1e-6)
    assert gearing.agrees(told, angles_deg, np.zeros(2), np.ones(2, bool))
    assert gearing.circle_deg(float(told)) == pytest.approx((told + 500.0) / 10_000.0 * 360.0)


@given(value=st.floats(-500.0, 9499.0), drawn_off_deg=st.floats(-7.0, 7.0))
def test_what_hands_contradict_each_other_by_as_drawn_is_taken_off(value: float, drawn_off_deg: float) -> None:
    """A hand that is drawn off, and its scale, tell as much more in every frame: it agrees where it moved along."""
    described = ALTIMETER.model_dump(exclude_unset=True)
    coarse, finest = described["needles"]
    drawn = gearing_of(ALTIMETER).within(0, np.array(finest["template"]["at"]))
    at_deg = float(gearing_of(ALTIMETER).angles_deg(1, drawn + 3000.0)) + drawn_off_deg
    coarse["template"] = {"at": at_deg, "span": 20}
    gearing = gearing_of(Gauge.model_validate(described))
    finest_deg = float(gearing.angles_deg(0, np.array(value)))
    coarse_deg = float(gearing_of(ALTIMETER).angles_deg(1, np.array(value))) + drawn_off_deg

    assert gearing.agrees(np.array(value), np.array([finest_deg, coarse_deg]), np.zeros(2), np.ones(2, bool))
    assert float(gearing.angles_deg(1, np.array(value))) % 360 == pytest.approx(coarse_deg % 360)


@given(direction_deg=st.floats(270.0, 629.0))
def test_direction_of_the_finest_hand_leaves_as_many_values_as_it_makes_turns(direction_deg: float) -> None:
    """Each is one turn of it apart, all within the dial's own turn."""
    (values,) = gearing_of(ALTIMETER).values(np.array([direction_deg]))

    assert len(values) == 10
    assert ((values >= -500.0) & (values < 9500.0)).all()
    assert np.diff(np.sort(values)) == pytest.approx(np.full(9, 1000.0))


@pytest.mark.parametrize(("off_deg", "seen", "agrees"), [(7.0, True, True), (8.0, True, False), (8.0, False, True)])
def test_hand_beyond_its_tolerance_contradicts_where_it_is_seen(off_deg: float, seen: bool, agrees: bool) -> None:  # noqa: FBT001
    """A fifth of a turn of the finest is 7.2 degrees of the next."""
    gearing = gearing_of(ALTIMETER)
    angles_deg = np.array([float(gearing.angles_deg(hand, np.array([2345.0]))[0]) for hand in (0, 1)])
    angles_deg[1] += off_deg

    assert bool(gearing.agrees(np.array(2345.0), angles_deg, np.zeros(2), np.array([True, seen]))) is agrees
