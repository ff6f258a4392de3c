"""Time as JSON: `{"sec": ..., "nsec": ...}`, Foxglove's form, exact in languages whose numbers are doubles."""

from __future__ import annotations

from typing import Any

from flight_file.frame import ClockReading, HostTimes

NS_PER_S = 1_000_000_000
MAX_LOG_TIME_NS = 2**64 - 1  # MCAP stores unsigned 64-bit nanoseconds


def to_json(time_ns: int) -> dict[str, int]:
    """Nanoseconds as `{"sec", "nsec"}`, 0 <= nsec < 10**9."""
    seconds, nanoseconds = divmod(time_ns, NS_PER_S)
    return {"sec": seconds, "nsec": nanoseconds}


def from_json(value: Any) -> int:  # noqa: ANN401 - it comes out of a file and is checked here
    """Nanoseconds of `{"sec", "nsec"}`; raises KeyError, TypeError or ValueError if it is something else."""
    seconds, nanoseconds = value["sec"], value["nsec"]
    if type(seconds) is not int or type(nanoseconds) is not int:
        raise TypeError("a time is not in whole seconds and nanoseconds")
    return seconds * NS_PER_S + nanoseconds


def reading_to_json(reading: ClockReading) -> dict[str, dict[str, int]]:
    """Both clocks."""
    return {"realtime": to_json(reading.realtime_ns), "monotonic": to_json(reading.monotonic_ns)}


def reading_from_json(value: Any) -> ClockReading:  # noqa: ANN401 - as above
    """Inverse of `reading_to_json`; raises as `from_json` does."""
    return ClockReading(realtime_ns=from_json(value["realtime"]), monotonic_ns=from_json(value["monotonic"]))


def host_times_to_json(times: HostTimes) -> dict[str, dict[str, dict[str, int]]]:
    """The three readings of a frame."""
    return {
        "before_request": reading_to_json(times.before_request),
        "after_answer": reading_to_json(times.after_answer),
        "downloaded": reading_to_json(times.downloaded),
    }


def host_times_from_json(value: Any) -> HostTimes:  # noqa: ANN401 - as above
    """Inverse of `host_times_to_json`; raises as `from_json` does."""
    return HostTimes(
        before_request=reading_from_json(value["before_request"]),
        after_answer=reading_from_json(value["after_answer"]),
        downloaded=reading_from_json(value["downloaded"]),
    )


def storable(time_ns: int) -> int:
    """The nearest time that an MCAP record can hold: 0 to 2**64 - 1 ns."""
    return min(max(time_ns, 0), MAX_LOG_TIME_NS)
