"""`NAME.csv`: one header row, one row for each frame; empty fields where there is no value."""

from __future__ import annotations

import csv
import math
from datetime import UTC, datetime
from typing import IO

from decoder.flight_data import STATUSES, FlightData, NeedleSeries
from decoder.panel import LEADING_COLUMNS, NEEDLE_SUFFIXES
from decoder.quantity import Quantity

SCORE_DECIMALS = 4
TIME_DECIMALS = 6
# A millionth of full scale is finer than any reading, and keeps small scales from losing digits.
DIGITS_OF_FULL_SCALE = 6


def write_csv(data: FlightData, stream: IO[str]) -> None:
    """Writes flight data as CSV: UTF-8, LF, floats always with a decimal point."""
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*LEADING_COLUMNS, *(s.quantity.name + suffix for s in data.series for suffix in NEEDLE_SUFFIXES)])
    decimals = [value_decimals(series) for series in data.series]
    time_s = data.time_s
    for row in range(len(data.frame)):
        fields = [str(data.frame[row]), utc_text(int(data.time_ns[row])), f"{time_s[row]:.{TIME_DECIMALS}f}"]
        for series, places in zip(data.series, decimals, strict=True):
            fields += [
                _number(value_within_turn(series.value[row], places, series.quantity), places),
                STATUSES[series.status[row]].value,
                _number(series.score[row], SCORE_DECIMALS),
                _number(series.sigma[row], places + 1),
            ]
        writer.writerow(fields)


def value_decimals(series: NeedleSeries) -> int:
    """Decimals of a needle's values: a millionth of full scale, at least one."""
    return max(1, DIGITS_OF_FULL_SCALE - 1 - math.floor(math.log10(series.quantity.full_scale)))


def value_within_turn(value: float, decimals: int, quantity: Quantity) -> float:
    """A value as it is written: one that rounds up to a full turn is the lowest."""
    if quantity.wraps is None or not math.isfinite(value):
        return value
    return quantity.lowest + (round(value, decimals) - quantity.lowest) % quantity.wraps


def utc_text(time_ns: int) -> str:
    """ISO 8601 UTC with microseconds."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest // 1000:06d}Z"


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if math.isfinite(value) else ""
