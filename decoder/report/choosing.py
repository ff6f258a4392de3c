"""Which frames' pictures go into the report, and which are left out when there is no room for all.

First come the frames of every flag, then the extremes and the steps of each needle, then an even sample. Each group is
in an order of which every beginning is spread over the flight, so that whatever there is room for is no one's pick.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from decoder.flight_data import FlightData, NeedleSeries
from decoder.report.flags import KINDS, Flag
from decoder.scale import shortest

STEPS = 3
SAMPLE = 240
MOST_PLANNED = 4000


def planned(data: FlightData, flags: Sequence[Flag]) -> list[int]:
    """Rows of the flight data whose pictures are wanted, the most wanted first."""
    last = len(data.frame) - 1
    wanted: dict[int, None] = {}

    def want(rows: Iterable[int]) -> None:
        wanted.update(dict.fromkeys(row for row in rows if 0 <= row <= last))

    for kind in KINDS:
        own = [flag for flag in flags if flag.kind is kind]
        scattered = [own[index] for index in scattered_order(len(own))]
        want((flag.first + flag.last) // 2 for flag in scattered)
    for kind in KINDS:
        own = [flag for flag in flags if flag.kind is kind]
        want(row for index in scattered_order(len(own)) for row in (own[index].first, own[index].last))
    want([0, last])
    for series in data.series:
        want(_extremes(series))
        want(_steps(series))
    for kind in KINDS[:2]:
        want(row for flag in flags if flag.kind is kind for row in (flag.first - 1, flag.last + 1))
    even = np.unique(np.linspace(0, max(last, 0), min(SAMPLE, last + 1)).round().astype(int)).tolist()
    want(even[index] for index in scattered_order(len(even)))
    return list(wanted)[:MOST_PLANNED]


def scattered_order(count: int) -> list[int]:
    """The numbers below `count` in an order of which every beginning is spread evenly (van der Corput's)."""
    bits = max(count - 1, 0).bit_length()
    reversed_bits = (int(f"{number:0{bits}b}"[::-1], 2) if bits else 0 for number in range(1 << bits))
    return [number for number in reversed_bits if number < count]


def _extremes(series: NeedleSeries) -> list[int]:
    """The rows of the lowest and highest value, and of the lowest score of any value."""
    valued = np.flatnonzero(np.isfinite(series.value))
    if not valued.size:
        return []
    value, score = series.value[valued], series.score[valued]
    return [int(valued[place]) for place in (value.argmin(), value.argmax(), score.argmin())]


def _steps(series: NeedleSeries) -> list[int]:
    """The rows before and after the largest steps between neighbouring values."""
    valued = np.flatnonzero(np.isfinite(series.value))
    sizes = np.abs(shortest(np.diff(series.value[valued]), series.quantity.wraps))
    largest = np.argsort(-sizes, kind="stable")[:STEPS]
    return [int(row) for place in largest if sizes[place] > 0 for row in (valued[place], valued[place + 1])]


class Room:
    """Hands out room for pictures to frames that come in the order of their rows, so that the most wanted get it.

    What the rest will need is told by what those before took.

    Parameters
    ----------
    wanted : rows, the most wanted first
    size_bytes : room for all of them together
    first_guess_bytes : what one is thought to take before any was seen
    """

    def __init__(self, wanted: Sequence[int], size_bytes: int, first_guess_bytes: int) -> None:
        self._rank = {row: rank for rank, row in enumerate(wanted)}
        self._waiting = np.ones(len(wanted), bool)
        self._left_bytes = size_bytes
        self._taken_bytes, self._taken = first_guess_bytes, 1

    def has_for(self, row: int) -> bool:
        """Whether this row's turn comes before the room is used up; asked once for each row."""
        rank = self._rank.get(row)
        if rank is None:
            return False
        self._waiting[rank] = False
        before = int(self._waiting[:rank].sum())
        return (before + 1) * self._taken_bytes / self._taken <= self._left_bytes

    def take(self, size_bytes: int) -> bool:
        """Takes room for one row's pictures; False, and nothing taken, if they do not fit."""
        if size_bytes > self._left_bytes:
            return False
        self._left_bytes -= size_bytes
        self._taken_bytes += size_bytes
        self._taken += 1
        return True
