"""A part of a flight: the frames between two times as people type them, or every N-th frame.

`90`, `90.5`, `1:30` and `0:01:30` are counted from the flight's first frame. Anything that ends with Z, or has a date,
is UTC: `12:01:30Z`, `2018-05-04 12:01:30`, `2018-05-04T12:01:30.25Z`, `2018-05-04T14:01:30+02:00`.

Times are found by bisecting the flight, so that only a few chunks are read. If a clock was set back during a recording,
a time may occur in several places; one of them is found.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from decoder.panel.errors import PartError

if TYPE_CHECKING:
    from flight_file.session import Session

NS_PER_S = 1_000_000_000
NS_PER_DAY = 86_400 * NS_PER_S
EXAMPLES = "90, 1:30, 12:01:30Z or 2018-05-04T12:01:30Z"

_SECONDS = re.compile(r"\d+(\.\d*)?|\.\d+")
_CLOCK = re.compile(r"((?P<hours>\d+):)?(?P<minutes>\d+):(?P<seconds>[0-5]\d(\.\d*)?)(?P<utc>[Zz])?")
_DATE = re.compile(
    r"(?P<second>\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?)(?P<fraction>\.\d+)?(?P<zone>[Zz]|[+-]\d\d:?\d\d)?"
)

# Displayed times have microseconds; typed in again they have to mean the frame they were displayed for.
SHOWN_NS = 1_000


@dataclass(frozen=True, slots=True)
class TypedTime:
    """A moment of a flight, once its start is known.

    Attributes
    ----------
    ns
        Counted from the flight's start, from midnight UTC, or from the Unix epoch.
    since
        Which of these.
    """

    ns: int
    since: str

    def at_ns(self, began_ns: int) -> int:
        """Return it in ns since the Unix epoch, for a flight that began then; a time of day is the first one after."""
        if self.since == "start":
            return began_ns + self.ns
        if self.since == "midnight":
            return began_ns + (self.ns - began_ns) % NS_PER_DAY
        return self.ns


def typed_time(text: str) -> TypedTime:
    """Parse a time as people type it.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    text = text.strip()
    if _SECONDS.fullmatch(text):
        return TypedTime(_ns(text), "start")
    clock = _CLOCK.fullmatch(text)
    if clock is not None:
        return _on_clock(clock)
    date = _DATE.fullmatch(text)
    if date is None:
        raise ValueError(f"{text!r} is no time: {EXAMPLES}")
    try:
        moment = datetime.fromisoformat(date["second"] + (date["zone"] or "Z").upper())
    except ValueError as error:
        raise ValueError(f"{text!r} is no time: {error}") from error
    whole = round((moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds())
    return TypedTime(whole * NS_PER_S + _ns(date["fraction"] or "0"), "epoch")


def _on_clock(clock: re.Match[str]) -> TypedTime:
    hours, minutes, rest_ns = int(clock["hours"] or 0), int(clock["minutes"]), _ns(clock["seconds"])
    if clock["utc"] is None:
        return TypedTime((hours * 3600 + minutes * 60) * NS_PER_S + rest_ns, "start")
    if clock["hours"] is None:  # 12:01Z is an hour and a minute
        hours, minutes, rest_ns = minutes, rest_ns // NS_PER_S, 0
    try:
        time(hours, minutes)
    except ValueError as error:
        raise ValueError(f"{clock[0]!r} is no time of a day") from error
    return TypedTime((hours * 3600 + minutes * 60) * NS_PER_S + rest_ns, "midnight")


def _ns(seconds: str) -> int:
    return int(Decimal(seconds) * NS_PER_S)


@dataclass(frozen=True, slots=True)
class AskedPart:
    """What the user wants of a flight; None where there is no bound."""

    start: TypedTime | None = None
    end: TypedTime | None = None
    every: int = 1

    @property
    def is_whole(self) -> bool:
        """Whether all of it is wanted."""
        return self.start is None and self.end is None and self.every == 1


@dataclass(frozen=True, slots=True)
class FlightPart:
    """Which frames of a flight.

    Attributes
    ----------
    ranks
        Of `range(Flight.count())`.
    frames_in_flight
        All of them, as its index counts them.
    began_ns
        When the flight's first frame was taken, since times stay those of the whole flight.
    """

    ranks: range
    frames_in_flight: int
    began_ns: int


class FrameTimes(Protocol):
    """What is needed to find a flight's parts: its files, and when each frame was taken, as far as known."""

    session: Session

    @property
    def paths(self) -> Sequence[Path]:
        """The files, in order."""

    def count(self) -> int:
        """Count the frames."""

    def captured_ns(self, rank: int) -> int | None:
        """Return when the frame of that rank was taken; None if it is damaged."""


def part_of(flight: FrameTimes, asked: AskedPart) -> FlightPart:
    """Find the frames that were asked for.

    Raises
    ------
    PartError
        If there are none.
    """
    frames = flight.count()
    began_ns = _time_ns(flight, 0, frames)
    if began_ns is None:
        raise PartError(f"{flight.paths[0].name}: holds no frames")
    first = 0 if asked.start is None else _rank_from(flight, asked.start.at_ns(began_ns))
    stop = frames if asked.end is None else _rank_from(flight, asked.end.at_ns(began_ns) + SHOWN_NS)
    ranks = range(first, stop, asked.every)
    if not ranks:
        raise PartError(f"{flight.paths[0].name}: no frame lies between --from and --to; {_span(flight, began_ns)}")
    return FlightPart(ranks, frames, began_ns)


def _span(flight: FrameTimes, began_ns: int) -> str:
    backwards = (flight.captured_ns(rank) for rank in reversed(range(flight.count())))
    end_ns = next((time for time in backwards if time is not None), began_ns)
    lasts = f"lasts {(end_ns - began_ns) / NS_PER_S:.2f} s"
    if not flight.session.knows_time_of_day:
        return f"the flight {lasts}"
    return f"the flight begins at {datetime.fromtimestamp(began_ns // NS_PER_S, UTC):%Y-%m-%dT%H:%M:%SZ} and {lasts}"


def _rank_from(flight: FrameTimes, time_ns: int) -> int:
    """Find the first frame taken then or later; the count of frames if there is none."""
    low, high = 0, flight.count()
    while low < high:
        middle = (low + high) // 2
        taken_ns = _time_ns(flight, middle, high)
        if taken_ns is None or taken_ns >= time_ns:
            high = middle
        else:
            low = middle + 1
    return low


def _time_ns(flight: FrameTimes, rank: int, stop: int) -> int | None:
    """Return when the frame of that rank was taken, or the next one that is intact."""
    times = (flight.captured_ns(each) for each in range(rank, stop))
    return next((time for time in times if time is not None), None)
