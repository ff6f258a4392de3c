"""Units and times as people write them."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.panel.errors import UnitError
from decoder.panel.units import UNITS, contrary_units, converted
from decoder.timeseries.flight_part import NS_PER_DAY, NS_PER_S, typed_time


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
    """Values from the definitions; an unknown unit equals itself."""
    assert converted(np.array([value]), source, target) == pytest.approx([expected], abs=1e-4)


@pytest.mark.parametrize(
    ("name", "unit", "said"),
    [
        ("asi_kt", "fpm", "kt"),
        ("asi_kt", "mph", "kt"),
        ("oil_temp_degF", "deg C", "degf"),
        ("egt_c", "deg F", "c"),
        ("flap_deg", "%", "deg"),
        ("asi_kt", "knots", None),
        ("oil_temp_deg", "deg C", None),
        ("bus_a", "V", None),
        ("turn_rate_norm", "standard rate", None),
        ("thousands_ft", "furlong", None),
        ("tach", "rpm", None),
    ],
)
def test_a_name_that_says_another_unit_is_told(name: str, unit: str, said: str | None) -> None:
    """Two names that were swapped, or a wrong unit, show in the name's end; a letter may be something else."""
    found = list(contrary_units([(name, unit)]))
    assert found == [] if said is None else f"gives {name} in {unit}, though that name says {said}" in found[0]


@given(st.floats(-1e4, 1e4), st.sampled_from(sorted(UNITS)), st.sampled_from(sorted(UNITS)))
def test_there_and_back(value: float, one: str, other: str) -> None:
    """Between units of a kind every value converts back; between kinds there is no conversion."""
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


NOON_NS = round(datetime(2018, 5, 4, 12, tzinfo=UTC).timestamp()) * NS_PER_S


@pytest.mark.parametrize(
    ("text", "after_s"),
    [
        ("0", 0), ("90", 90), ("90.25", 90.25), (".5", 0.5), (" 7 ", 7), ("1:30", 90), ("90:00", 5400),
        ("0:01:30.5", 90.5), ("1:00:00", 3600),
        ("12:00:00Z", 0), ("12:01:30Z", 90), ("12:01z", 60), ("12:00:00.25Z", 0.25), ("11:00:00Z", 23 * 3600),
        ("2018-05-04T12:01:30Z", 90), ("2018-05-04 12:01:30", 90), ("2018-05-04T12:01:30.250000Z", 90.25),
        ("2018-05-04T14:01:30+02:00", 90), ("2018-05-04T14:01:30+0200", 90), ("2018-05-04 12:01", 60),
        ("2018-05-04T11:59:00Z", -60),
    ],
)  # fmt: skip
def test_time_is_what_it_looks_like(text: str, after_s: float) -> None:
    """Of a flight that began at noon UTC: seconds, a clock from the start, a time of day, or a date and time."""
    assert typed_time(text).at_ns(NOON_NS) - NOON_NS == after_s * NS_PER_S


@pytest.mark.parametrize(
    "text",
    ["", "x", "-5", "1:75", "25:00:00Z", "24:00Z", "2018-02-30 12:00", "2018-05-04", "1e3", "12 s", "nan", "1:2:3:4"],
)
def test_anything_else_is_refused(text: str) -> None:
    """A text that is not a time is reported as such."""
    with pytest.raises(ValueError, match="no time"):
        typed_time(text)


@given(began_ns=st.integers(0, 2**62), second=st.integers(0, 86_399))
def test_time_of_day_is_the_first_one_after_the_start(began_ns: int, second: int) -> None:
    """A flight over midnight has its early morning after its late evening."""
    text = f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d}Z"
    at_ns = typed_time(text).at_ns(began_ns)

    assert 0 <= at_ns - began_ns < NS_PER_DAY
    assert at_ns % NS_PER_DAY == second * NS_PER_S
