"""Three pointers together give one value or none."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.alignment import IDENTITY
from decoder.instruments.kinds.dials.geared import told_together
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.panel.panel import parse_panel
from decoder.panel.scale import shortest
from decoder.timeseries.flight_data import STATUSES, FlightData, FlightDataBuilder
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.instruments.altimeters import ALTIMETER, TURNS_FT, angles_of
from tests.decoder.instruments.dials import CENTRE

BAD = Reading(Status.MISSING, 300.0, 0.5, 0.4)


def combined(readings: list[Mapping[str, Reading]], **gauge: Any) -> FlightData:  # noqa: ANN401
    """The flight data of such readings, half a second apart; systematic errors are none."""
    content = {
        "name": "altimeter",
        "picture": "panel.png",
        "anchors": [{"name": "texture", "box": [196, 22, 36, 36]}],
        "gauges": [copy.deepcopy(ALTIMETER) | {"centre": list(CENTRE)} | gauge],
    }
    panel = parse_panel(yaml.safe_dump(content))
    (own,), builder = panel.gauges, FlightDataBuilder(panel)
    for index, frame in enumerate(readings):
        together = dict(frame) if "altitude_ft" in frame else {**frame, "altitude_ft": told_together(own, frame)}
        builder.add(index, index * 500_000_000, FrameReadings(IDENTITY, together))
    return fill_gaps(builder.build(lambda _, angles_deg: np.zeros_like(angles_deg)))


def pointing(altitude_ft: float, off_deg: Mapping[str, float] | None = None) -> dict[str, Reading]:
    """The three pointers of an altitude, each off by so many degrees."""
    angles = zip(TURNS_FT, angles_of(altitude_ft), strict=True)
    return {
        name: Reading(Status.READ, 270.0 + (angle_deg + (off_deg or {}).get(name, 0.0) - 270.0) % 360.0, 0.05, 0.99)
        for name, angle_deg in angles
    }


@given(
    altitude_ft=st.floats(0.0, 99_999.0),
    off_deg=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
)
@settings(max_examples=30)
def test_coarse_pointers_count_and_the_finest_measures(altitude_ft: float, off_deg: tuple[float, float]) -> None:
    """Coarse pointers may be off by several degrees: the value is the finest one's all the same."""
    off = {"ten_thousands_ft": off_deg[0], "thousands_ft": off_deg[1]}
    (altitude,) = combined([pointing(altitude_ft, off)]).series[-1:]

    assert altitude.quantity.name == "altitude_ft"
    assert altitude.has(Status.READ).all()
    assert abs(shortest(altitude.value - altitude_ft, 100_000.0)) < 1e-4
    assert 0.0 <= altitude.value[0] < 100_000.0


@given(altitude_ft=st.floats(0.0, 99_999.0), off_deg=st.floats(8.0, 28.0) | st.floats(-28.0, -8.0))
@pytest.mark.parametrize("pointer", ["ten_thousands_ft", "thousands_ft"])
@settings(max_examples=20)
def test_pointers_that_contradict_each_other_are_no_value(pointer: str, altitude_ft: float, off_deg: float) -> None:
    """The altitude is missing and stays so between good ones; the pointers keep what was read of them, as `edge`."""
    good, bad = pointing(altitude_ft), pointing(altitude_ft, {pointer: off_deg})
    data = combined([good, bad, good])
    altitude = data.series[-1]

    assert [STATUSES[code] for code in altitude.status] == [Status.READ, Status.MISSING, Status.READ]
    assert np.isnan(altitude.value[1])
    pointers = data.series[:-1]
    assert all(series.has(Status.READ).tolist() == [True, False, True] for series in pointers)
    assert all(series.has(Status.EDGE).tolist() == [False, True, False] for series in pointers)


def test_altitude_of_a_pointer_that_is_not_seen_is_interpolated() -> None:
    """A gap in one pointer is a gap in the value, filled like any other."""
    good = [pointing(altitude_ft) for altitude_ft in (9_800.0, 9_900.0, 10_000.0, 10_100.0)]
    data = combined([good[0], good[1] | {"thousands_ft": BAD}, good[2] | {"hundreds_ft": BAD}, good[3]])
    altitude = data.series[-1]

    assert [STATUSES[code].value[0] for code in altitude.status] == ["r", "i", "i", "r"]
    assert altitude.value == pytest.approx([9_800.0, 9_900.0, 10_000.0, 10_100.0])
    assert (altitude.sigma[1:3] > altitude.sigma[0]).all()


def test_values_begin_at_the_lowest() -> None:
    """An altitude is below zero if the panel allows it."""
    own = ALTIMETER["combined"] | {"lowest": -1000}

    assert combined([pointing(-40.0)], combined=own).series[-1].value[0] == pytest.approx(-40.0)
    assert combined([pointing(-40.0)]).series[-1].value[0] == pytest.approx(99_960.0)
