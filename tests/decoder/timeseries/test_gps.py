"""The camera's GPS at the frames: on straight lines between samples with a fix, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.panel.arrays import Floats
from decoder.panel.scale import Quantity
from decoder.timeseries.flight_data import FlightData, NeedleSeries
from decoder.timeseries.flight_decoder import with_gps
from decoder.timeseries.gps import GpsData, resampled
from flight_file.frame import FIX_3D, NO_FIX, GpsFix

SECOND = 10**9


def sample(
    time_s: float, north_m: float, east_m: float, *, altitude_m: float = 300.0, speed_mps: float = 50.0
) -> GpsFix:
    """A sample so far north and east of 60 degrees north, 10 degrees east, where a degree east is half as long."""
    degree_m = math.radians(1) * 6_371_008.8
    return GpsFix(
        round(time_s * SECOND),
        fix=FIX_3D,
        latitude_deg=60 + north_m / degree_m,
        longitude_deg=10 + east_m / (degree_m / 2),
        altitude_m=altitude_m,
        speed_mps=speed_mps,
        dop=1.5,
    )


def at(fixes: list[GpsFix], times_s: list[float]) -> dict[str, Floats]:
    """The columns at these times."""
    found = resampled(fixes, np.array([round(time_s * SECOND) for time_s in times_s]))
    assert isinstance(found, GpsData)
    return {column.name: column.values for column in found.columns}


def test_values_lie_on_straight_lines_between_samples_and_not_beyond() -> None:
    """In the units of the names' endings: 3.048 m/s of climb are ten feet a second; none before or after."""
    fixes = [sample(place, 0, 0, altitude_m=304.8 + 3.048 * place, speed_mps=51.4444 * place) for place in range(3)]
    columns = at(fixes, [-0.01, 0.0, 0.25, 1.5, 2.0, 2.01])

    assert columns["gps_altitude_ft"] == pytest.approx([np.nan, 1000, 1002.5, 1015, 1020, np.nan], nan_ok=True)
    assert columns["gps_speed_kt"] == pytest.approx([np.nan, 0, 25, 150, 200, np.nan], rel=1e-5, nan_ok=True)


@pytest.mark.parametrize("bearing_deg", [0, 45, 271.5])
def test_track_is_the_way_it_went(bearing_deg: float) -> None:
    """Clockwise from true north, also where degrees east are short."""
    north, east = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    fixes = [sample(place / 10, 5 * place * north, 5 * place * east) for place in range(31)]
    track = at(fixes, [0.4, 0.5, 1.0, 2.5, 2.6])["gps_track_deg"]

    assert track[1:4] == pytest.approx([bearing_deg] * 3, abs=0.01)
    assert np.isnan(track[[0, 4]]).all()


def test_at_a_standstill_there_is_no_track() -> None:
    """A distance no longer than the precision, in metres, is noise."""
    for speed_mps, known in ((1.4, False), (1.6, True)):
        fixes = [sample(place / 10, speed_mps * place / 10, 0) for place in range(31)]

        assert np.isfinite(at(fixes, [1.5])["gps_track_deg"]) == [known]


def test_the_date_line_is_no_jump() -> None:
    """Half way between 179.9 east and 179.9 west is 180."""
    fixes = [
        GpsFix(place * SECOND, fix=3, latitude_deg=0.0, longitude_deg=each)
        for place, each in enumerate((179.9, -179.9))
    ]
    columns = at(fixes, [0.25, 0.5, 0.75])

    assert np.abs(columns["gps_longitude_deg"]) == pytest.approx([179.95, 180, 179.95])
    assert np.isnan(columns["gps_altitude_ft"]).all()


@given(
    known=st.lists(st.booleans(), min_size=1, max_size=20),
    steps=st.lists(st.sampled_from((0.1, 0.5, 1.0, 1.1, 3.0)), min_size=20, max_size=20),
)
def test_there_is_a_value_only_between_two_samples_with_a_fix_a_second_apart_at_most(
    known: list[bool], steps: list[float]
) -> None:
    """Whatever is lost, and whatever values a sample without a fix has."""
    times_s = np.cumsum(steps)[: len(known)]
    fixes = [
        sample(time_s, 0, 0) if has_fix else replace(sample(time_s, 0, 0), fix=NO_FIX)
        for time_s, has_fix in zip(times_s.tolist(), known, strict=True)
    ]
    middles_s = ((times_s[1:] + times_s[:-1]) / 2).tolist()
    columns = at(fixes, [*times_s.tolist(), *middles_s])
    between = [
        one and other and step <= 1
        for one, other, step in zip(known, known[1:], np.diff(times_s).round(9), strict=False)
    ]

    for name in ("gps_latitude_deg", "gps_longitude_deg", "gps_altitude_ft", "gps_speed_kt"):
        assert np.isfinite(columns[name]).tolist() == [*known, *between], name


def test_a_needle_keeps_its_name() -> None:
    """The GPS's value is left out, with a warning."""
    quantity = Quantity("gps_speed_kt", "dial", "kt", ((0.0, 0.0), (90.0, 100.0)), None, None, None)
    needle = NeedleSeries(quantity, np.zeros(1, np.uint8), *[np.zeros(1)] * 4)
    found = with_gps(
        FlightData(np.zeros(1, int), np.zeros(1, int), (needle,), ()),
        [sample(place / 10, 5.0 * place, 0) for place in range(20)],
    )

    assert found.gps is not None
    assert "gps_speed_kt" not in [column.name for column in found.gps.columns]
    assert len(found.gps.columns) == 4
    assert found.warnings == ("the panel has a needle called gps_speed_kt; what the GPS says of it is left out",)


def test_a_flight_without_samples_has_no_columns() -> None:
    """So nothing changes for flights of other cameras; one that never had a fix has empty columns."""
    found = resampled([GpsFix(0)], np.array([0]))

    assert resampled([], np.array([0])) is None
    assert found is not None
    assert (found.without_fix, found.samples, found.located.tolist()) == (1, 1, [False])
