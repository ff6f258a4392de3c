"""Outliers: values that the frames around them make implausible. They are reported, and never changed.

There are two tests, both only for values that were seen on the dial, not for interpolated ones: whether a value leaves
the line of its neighbours for a few frames and comes back to it, and whether it was reached faster than the panel's
`max_rate` allows. A step is not an outlier, since the value does not come back. Neither is a value next to a pause in
the recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.instruments.reading import Status
from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.scale import shortest
from decoder.timeseries.flight_data import FlightData, NeedleSeries, spans
from decoder.timeseries.thresholds import BACK_PART, MOST_STRETCHED, SMALLEST_PART

SEEN = (Status.READ, Status.EDGE)
# A value that stays away for longer than this has really moved.
LONGEST_FRAMES = 3
RATE_SPREADS = 3.0


Index = NDArray[np.intp]


class Reason(StrEnum):
    """Why a value is implausible."""

    AWAY_AND_BACK = "leaves its neighbours and comes back"
    TOO_FAST = "changes faster than max_rate"


@dataclass(frozen=True, slots=True)
class Outlier:
    """A run of implausible values; `first` and `last` are indices into the flight data's rows."""

    needle: str
    first: int
    last: int
    reason: Reason


def find_outliers(data: FlightData) -> list[Outlier]:
    """Find all outliers, by needle in the columns' order, then by time."""
    measured = (series for series in data.series if series.quantity.written is None)
    return [outlier for series in measured for outlier in _outliers(series, data.time_s)]


def _outliers(series: NeedleSeries, time_s: Floats) -> list[Outlier]:
    seen = np.flatnonzero(series.has(*SEEN))
    values, sigma, seconds = series.value[seen], series.sigma[seen], time_s[seen]
    away = _away_and_back(values, sigma, seconds, series, pauses_before(time_s)[seen])
    fast = np.zeros_like(away)
    if series.quantity.max_rate is not None:
        steps = shortest(np.diff(values), series.quantity.wraps)
        doubt = RATE_SPREADS * np.hypot(sigma[1:], sigma[:-1])
        fast[1:] = np.abs(steps) > series.quantity.max_rate * np.maximum(np.diff(seconds), 0.0) + doubt
    found = [(where, Reason.AWAY_AND_BACK) for where in spans(away)]
    found += [(where, Reason.TOO_FAST) for where in spans(fast & ~away)]
    return [
        Outlier(series.quantity.name, int(seen[first]), int(seen[last]), reason)
        for (first, last), reason in sorted(found)
    ]


def pauses_before(time_s: Floats) -> NDArray[np.intp]:
    """(N,): how many pauses of the recording precede each frame; values across a pause are not compared."""
    steps = np.diff(time_s)
    usual = float(median(steps)) if steps.size else 0.0
    return np.concatenate([[0], np.cumsum(steps > MOST_STRETCHED * usual)]).astype(np.intp)[: len(time_s)]


def _away_and_back(
    values: Floats, sigma: Floats, seconds: Floats, series: NeedleSeries, pauses: NDArray[np.intp]
) -> Mask:
    """(N,): values that are off the line between the values before and after them."""
    candidates: list[tuple[float, int, int]] = []
    for frames in range(1, LONGEST_FRAMES + 1):
        count = len(values) - frames - 1
        if count < 1:
            break
        before, after = np.arange(count), np.arange(count) + frames + 1
        across = shortest(values[after] - values[before], series.quantity.wraps)
        off, limit = [], []
        for inside in range(1, frames + 1):
            part = (seconds[before + inside] - seconds[before]) / np.maximum(seconds[after] - seconds[before], 1e-9)
            gone = shortest(values[before + inside] - values[before], series.quantity.wraps)
            off.append(gone - across * np.clip(part, 0.0, 1.0))
            limit.append(
                BEYOND_CHANCE_SPREADS * np.sqrt(sigma[before + inside] ** 2 + sigma[before] ** 2 + sigma[after] ** 2)
            )
        distance = np.array(off)
        usual = MAD_TO_SIGMA * float(median(np.abs(distance).ravel()))
        threshold = np.maximum(
            np.array(limit), max(BEYOND_CHANCE_SPREADS * usual, SMALLEST_PART * series.quantity.full_scale)
        )
        one_way = np.abs(np.sign(distance).sum(axis=0)) == frames
        apart = (np.abs(distance) > threshold).all(axis=0) & one_way
        steady = _steady(values, seconds, before, after, series) * (seconds[after] - seconds[before])
        apart &= np.abs(across) < BACK_PART * np.abs(distance).min(axis=0) + steady
        apart &= pauses[after] == pauses[before]
        nearest = np.abs(distance).min(axis=0)
        candidates += [(-float(nearest[start]), start, start + frames + 1) for start in before[apart].tolist()]
    away = np.zeros(len(values), bool)
    for _, start, end in sorted(candidates):  # the furthest off first, since it makes its neighbours look off
        if not away[start : end + 1].any():
            away[start + 1 : end] = True
    return away


def _steady(values: Floats, seconds: Floats, before: Index, after: Index, series: NeedleSeries) -> Floats:
    """Return the speed that the needle kept both up to a frame and from a later one: units per second, 0 if none."""
    rates = shortest(np.diff(values), series.quantity.wraps) / np.maximum(np.diff(seconds), 1e-9)
    rates = np.concatenate([[0.0], rates, [0.0]])  # rates[i] is the one up to value i
    up_to, onward = rates[before], rates[after + 1]
    steady: Floats = np.where(up_to * onward > 0, np.minimum(np.abs(up_to), np.abs(onward)), 0.0)
    return steady
