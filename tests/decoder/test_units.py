"""Units: known equivalents, and the way there and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.errors import UnitError
from decoder.units import UNITS, converted


@pytest.mark.parametrize(
    ("value", "source", "target", "expected"),
    [
        (100.0, "kt", "mph", 115.077945),
        (1000.0, "ft", "m", 304.8),
        (100.0, "deg C", "deg F", 212.0),
        (-40.0, "deg F", "deg C", -40.0),
        (0.0, "deg C", "K", 273.15),
        (1013.25, "hPa", "inHg", 29.9213),
        (1.0, "bar", "psi", 14.503774),
        (5.08, "m/s", "fpm", 1000.0),
        (10.0, "gph", "l/h", 37.85411784),
        (100.0, "lb", "kg", 45.359237),
        (42.0, "Ft  Baro", "feet", 42.0),
        (42.0, "furlong", "furlong", 42.0),
    ],
)
def test_equivalents(value: float, source: str, target: str, expected: float) -> None:
    """Values from the definitions; a unit is itself even if nobody knows it."""
    assert converted(np.array([value]), source, target) == pytest.approx([expected], abs=1e-4)


@given(st.floats(-1e4, 1e4), st.sampled_from(sorted(UNITS)), st.sampled_from(sorted(UNITS)))
def test_there_and_back(value: float, one: str, other: str) -> None:
    """Between units of a kind every value comes back; between kinds there is no way."""
    if UNITS[one].kind != UNITS[other].kind:
        with pytest.raises(UnitError, match="there is no way from"):
            converted(np.array([value]), one, other)
        return
    there = converted(np.array([value]), one, other)
    assert converted(there, other, one) == pytest.approx([value], rel=1e-9, abs=1e-6)


def test_unknown_unit_is_named() -> None:
    """The message says which units are known."""
    with pytest.raises(UnitError, match=r"the unit 'furlong' is not known; known are kt, mph"):
        converted(np.array([1.0]), "kt", "furlong")
