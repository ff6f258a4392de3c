"""The camera's GPS at the frames: position, speed and direction, in addition to the panel's readings.

Values are interpolated linearly between the receiver's samples before and after a frame. There is none if one of the
two has no fix, if they are more than a second apart, or before the first and after the last: nothing is extrapolated.
The direction is the bearing from half a second before to half a second after; there is none if that distance is not
longer than the fix's dilution of precision in metres, since at a standstill it would be noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.panel.units import FOOT_M, HOUR_S
from flight_file.frame import NO_FIX, NS_PER_S, GpsFix

TRACK = "gps_track_deg"
EARTH_M = 6_371_008.8  # mean radius; over a second of flight the ellipsoid makes no difference
_HALF_TURN_DEG = FULL_CIRCLE_DEG / 2
_KT_MPS = 1852 / HOUR_S


@dataclass(frozen=True, slots=True)
class GpsColumn:
    """One quantity at every frame: (N,) values in this unit, NaN where there is none, and its number of decimals."""

    name: str
    unit: str
    decimals: int
    values: Floats

    def number(self, row: int) -> float | None:
        """Round the value of a row for output; None where there is none. A bearing stays below 360."""
        value = round(float(self.values[row]), self.decimals)
        if not math.isfinite(value):
            return None
        return value % FULL_CIRCLE_DEG if self.name == TRACK else value


@dataclass(frozen=True, slots=True)
class GpsData:
    """What the camera's GPS says of a flight.

    Attributes
    ----------
    columns
        At the frames.
    located
        (N,): which frames have a position.
    samples, without_fix
        How many samples of the receiver are in the flight, and how many of them have no fix.
    """

    columns: tuple[GpsColumn, ...]
    located: NDArray[np.bool_]
    samples: int
    without_fix: int

    def without(self, names: Iterable[str]) -> GpsData:
        """Leave out columns with these names."""
        taken = set(names)
        return replace(self, columns=tuple(column for column in self.columns if column.name not in taken))


def resampled(fixes: Iterable[GpsFix], time_ns: NDArray[np.int64]) -> GpsData | None:
    """Interpolate a receiver's samples at the frames.

    Parameters
    ----------
    fixes
        In any order.
    time_ns
        (N,): the frames' times.

    Returns
    -------
    GpsData or None
        None if the flight has no sample at all, with or without a fix.
    """
    track = _Track.of(fixes)
    if not len(track.time_ns):
        return None
    latitude_deg = track.at(track.latitude_deg, time_ns)
    columns = (
        GpsColumn("gps_latitude_deg", "deg", 7, latitude_deg),
        GpsColumn("gps_longitude_deg", "deg", 7, track.at(track.longitude_deg, time_ns, wraps=FULL_CIRCLE_DEG)),
        GpsColumn("gps_altitude_ft", "ft", 1, track.at(track.altitude_m, time_ns) / FOOT_M),
        GpsColumn("gps_speed_kt", "kt", 2, track.at(track.speed_mps, time_ns) / _KT_MPS),
        GpsColumn(TRACK, "deg", 1, track.bearing_deg(time_ns)),
    )
    lost = int(np.isnan(track.latitude_deg).sum())
    return GpsData(columns, np.isfinite(latitude_deg), len(track.time_ns), lost)


@dataclass(frozen=True)
class _Track:
    """(M,) samples in order of time, each time once; NaN where the receiver gave no value."""

    time_ns: NDArray[np.int64]
    latitude_deg: Floats
    longitude_deg: Floats
    altitude_m: Floats
    speed_mps: Floats
    dop: Floats

    @classmethod
    def of(cls, fixes: Iterable[GpsFix]) -> _Track:
        rows = sorted(
            (
                (fix.captured_ns, fix.latitude_deg, fix.longitude_deg, fix.altitude_m, fix.speed_mps, fix.dop)
                if fix.fix != NO_FIX
                else (fix.captured_ns, None, None, None, None, None)  # a file may give a position even without a fix
                for fix in fixes
            ),
            key=lambda row: row[0],
        )
        times, first = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
        columns = [np.array([row[place] for row in rows], float)[first] for place in range(1, 6)]
        return cls(times, *columns)

    @cached_property
    def _began_ns(self) -> int:
        return int(self.time_ns[0])

    def at(self, values: Floats, time_ns: NDArray[np.int64], *, wraps: float | None = None) -> Floats:
        """Interpolate (M,) values at (N,) times; values that repeat after `wraps` stay within half of it."""
        last = len(self.time_ns) - 1
        after = np.clip(np.searchsorted(self.time_ns, time_ns), 0, last)
        exact = self.time_ns[after] == time_ns
        before = np.where(exact, after, np.maximum(after - 1, 0))
        span_ns = self.time_ns[after] - self.time_ns[before]
        step = values[after] - values[before]
        if wraps is not None:
            step = (step + wraps / 2) % wraps - wraps / 2
        found = values[before] + step * ((time_ns - self.time_ns[before]) / np.maximum(span_ns, 1))
        if wraps is not None:
            found = (found + wraps / 2) % wraps - wraps / 2
        inside = (time_ns >= self._began_ns) & (time_ns <= self.time_ns[last]) & (span_ns <= NS_PER_S)
        return np.where(inside, found, np.nan)

    def bearing_deg(self, time_ns: NDArray[np.int64]) -> Floats:
        """Return the direction of movement at (N,) times, degrees from true north, clockwise, below 360."""
        ends = [time_ns - NS_PER_S // 2, time_ns + NS_PER_S // 2]
        (south, north), (west, east) = (
            [self.at(values, end, wraps=wraps) for end in ends]
            for values, wraps in ((self.latitude_deg, None), (self.longitude_deg, FULL_CIRCLE_DEG))
        )
        up_m = np.radians(north - south) * EARTH_M
        turn_deg = (east - west + _HALF_TURN_DEG) % FULL_CIRCLE_DEG - _HALF_TURN_DEG
        right_m = np.radians(turn_deg) * EARTH_M * np.cos(np.radians((north + south) / 2))
        here = np.isfinite(self.at(self.latitude_deg, time_ns))
        moved = here & (np.hypot(up_m, right_m) > self.at(self.dop, time_ns))
        bearing: Floats = np.degrees(np.arctan2(right_m, up_m)) % FULL_CIRCLE_DEG
        return np.where(moved, bearing, np.nan)
