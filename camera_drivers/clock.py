"""A camera driver's access to time: it reads both clocks and waits interruptibly."""

from __future__ import annotations

import threading
from typing import Protocol

from flight_file.frame import ClockReading


class Clock(Protocol):
    """A source of time that is passed in; tests and fast replays bring their own."""

    def read(self) -> ClockReading:
        """Read both clocks."""
        ...

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Wait until the monotonic clock has reached this time (ns), or `stop` is set."""
        ...


def realtime_ns(monotonic_ns: int, near: ClockReading) -> int:
    """Convert a time of the monotonic clock to UTC, by a reading of both clocks near it."""
    return near.realtime_ns - (near.monotonic_ns - monotonic_ns)
