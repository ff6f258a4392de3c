"""Gearing: where hands point at a value, and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.kinds.dials.geared import gearing_of
from decoder.panel.gauge import Gauge

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


@given(direction_deg=st.floats(270.0, 629.0))
def test_direction_of_the_finest_hand_leaves_as_many_values_as_it_makes_turns(direction_deg: float) -> None:
    """Each is one turn of it on, all of them within the dial's own turn."""
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
