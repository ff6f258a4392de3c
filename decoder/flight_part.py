"""A part of a flight: the frames between two times, or every so many of them.

Times are found by halving the flight, so that a few chunks are read and not all; where a clock was set back during a
recording there may be more than one place with a time, and it is one of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from decoder.errors import PartError
from decoder.typed_time import NS_PER_S, TypedTime
from flight_file.reader import Flight

# Times that are shown have microseconds; typed again they mean the frame that they were shown for.
SHOWN_NS = 1_000


@dataclass(frozen=True, slots=True)
class AskedPart:
    """What somebody wants of a flight; None where there is no bound."""

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
        All, as its index counts them.
    began_ns
        When the flight's first frame was taken: times stay those of the whole flight.
    """

    ranks: range
    frames_in_flight: int
    began_ns: int


def part_of(flight: Flight, asked: AskedPart) -> FlightPart:
    """The frames that were asked for.

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


def _span(flight: Flight, began_ns: int) -> str:
    backwards = (flight.captured_ns(rank) for rank in reversed(range(flight.count())))
    end_ns = next((time for time in backwards if time is not None), began_ns)
    began = datetime.fromtimestamp(began_ns // NS_PER_S, UTC)
    return f"the flight begins at {began:%Y-%m-%dT%H:%M:%SZ} and lasts {(end_ns - began_ns) / NS_PER_S:.2f} s"


def _rank_from(flight: Flight, time_ns: int) -> int:
    """The first rank whose frame was taken then or later; behind the last if none was."""
    low, high = 0, flight.count()
    while low < high:
        middle = (low + high) // 2
        taken_ns = _time_ns(flight, middle, high)
        if taken_ns is None or taken_ns >= time_ns:
            high = middle
        else:
            low = middle + 1
    return low


def _time_ns(flight: Flight, rank: int, stop: int) -> int | None:
    """When the frame of that rank was taken, or the next one that is whole."""
    times = (flight.captured_ns(each) for each in range(rank, stop))
    return next((time for time in times if time is not None), None)
