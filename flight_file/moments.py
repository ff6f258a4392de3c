"""Time as JSON: `{"sec": ..., "nsec": ...}`, Foxglove's form, exact in languages whose numbers are doubles.

The classes are what msgspec makes of it, checked.
"""

from __future__ import annotations

import msgspec

from flight_file.frame import ClockReading, HostTimes

NS_PER_S = 1_000_000_000
MAX_LOG_TIME_NS = 2**64 - 1  # MCAP stores unsigned 64-bit nanoseconds


def to_json(time_ns: int) -> dict[str, int]:
    """Nanoseconds as `{"sec", "nsec"}`, 0 <= nsec < 10**9."""
    seconds, nanoseconds = divmod(time_ns, NS_PER_S)
    return {"sec": seconds, "nsec": nanoseconds}


class Moment(msgspec.Struct, frozen=True):
    """Inverse of `to_json`."""

    sec: int
    nsec: int

    @property
    def time_ns(self) -> int:
        """Nanoseconds."""
        return self.sec * NS_PER_S + self.nsec


def reading_to_json(reading: ClockReading) -> dict[str, dict[str, int]]:
    """Both clocks."""
    return {"realtime": to_json(reading.realtime_ns), "monotonic": to_json(reading.monotonic_ns)}


class Clocks(msgspec.Struct, frozen=True):
    """Inverse of `reading_to_json`."""

    realtime: Moment
    monotonic: Moment

    @property
    def reading(self) -> ClockReading:
        """What both said."""
        return ClockReading(self.realtime.time_ns, self.monotonic.time_ns)


def host_times_to_json(times: HostTimes) -> dict[str, dict[str, dict[str, int]]]:
    """The three readings of a frame."""
    return {
        "before_request": reading_to_json(times.before_request),
        "after_answer": reading_to_json(times.after_answer),
        "downloaded": reading_to_json(times.downloaded),
    }


class HostClocks(msgspec.Struct, frozen=True):
    """Inverse of `host_times_to_json`."""

    before_request: Clocks
    after_answer: Clocks
    downloaded: Clocks

    @property
    def times(self) -> HostTimes:
        """The three readings of a frame."""
        return HostTimes(self.before_request.reading, self.after_answer.reading, self.downloaded.reading)


def storable(time_ns: int) -> int:
    """The nearest time that an MCAP record can hold: 0 to 2**64 - 1 ns."""
    return min(max(time_ns, 0), MAX_LOG_TIME_NS)
