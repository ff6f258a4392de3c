"""Which frames of a flight to look at: at given times, every so many, or those in which something is doubtful."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decoder.flight_data import FlightData
from decoder.outliers import find_outliers
from decoder.reading import Status

Rows = NDArray[np.int64]
"""Rows of the flight data, rising."""


def nearest(data: FlightData, at_s: Sequence[float]) -> Rows:
    """The frames nearest to some times since the first frame."""
    if not len(data.frame):
        return np.empty(0, np.int64)
    return np.unique([int(np.abs(data.time_s - time_s).argmin()) for time_s in at_s])


def flagged(data: FlightData) -> Rows:
    """The frames in which a value is interpolated or missing, or hard to believe."""
    doubtful = np.zeros(len(data.frame), bool)
    for series in data.series:
        doubtful |= series.has(Status.INTERPOLATED, Status.MISSING)
    for outlier in find_outliers(data):
        doubtful[outlier.first : outlier.last + 1] = True
    return np.flatnonzero(doubtful)


def every(data: FlightData, step: int) -> Rows:
    """The first frame and every `step`-th from there."""
    return np.arange(0, len(data.frame), step)
