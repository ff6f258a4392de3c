"""The flight data as the page holds them: little-endian arrays in base64, rows in the order of time.

Values need no more than single precision beside their uncertainty, a status is a byte; seven needles of a two-hour
flight at 4 Hz take 2.6 MB so.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decoder.csv_output import utc_text
from decoder.drawn_readings import label_decimals
from decoder.flight_data import FlightData, NeedleSeries

Order = NDArray[np.int64]
"""(N,): rows of the flight data, in the order of time."""


def order_of(data: FlightData) -> Order:
    """The rows by time; a clock that was set back leaves them in another order than they were taken in."""
    return np.argsort(data.time_ns, kind="stable").astype(np.int64)


def packed(values: NDArray[Any], kind: str) -> dict[str, str]:
    """An array for the page; `kind` is numpy's name for its numbers, such as `f4`."""
    return {"kind": kind, "data": base64.b64encode(np.ascontiguousarray(values, "<" + kind).tobytes()).decode()}


def columns(data: FlightData, order: Order) -> dict[str, Any]:
    """Times, frame numbers and needles."""
    start_ns = int(data.time_ns[order[0]]) if order.size else 0
    return {
        "rows": int(order.size),
        "start_ms": start_ns / 1e6,
        "start_utc": utc_text(start_ns),
        "since_first_ms": float(data.time_ns[0] - start_ns) / 1e6 - float(data.time_s[0]) * 1e3 if order.size else 0.0,
        "time_ms": packed((data.time_ns[order] - start_ns) / 1e6, "f8"),
        "frame": packed(data.frame[order], "f8"),
        "needles": [_needle(series, order) for series in data.series],
    }


def _needle(series: NeedleSeries, order: Order) -> dict[str, Any]:
    quantity = series.quantity
    return {
        "name": quantity.name,
        "gauge": quantity.gauge,
        "unit": quantity.unit,
        "decimals": label_decimals(series),
        "wraps": quantity.wraps,
        "full_scale": quantity.full_scale,
        "value": packed(series.value[order], "f4"),
        "sigma": packed(series.sigma[order], "f4"),
        "score": packed(series.score[order], "f4"),
        "status": packed(series.status[order], "u1"),
    }
