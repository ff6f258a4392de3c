"""Clocks: the machine's, and one that jumps instead of waiting."""

from __future__ import annotations

import threading
import time

from flight_file.frame import ClockReading

_NS_PER_S = 1_000_000_000


class SystemClock:
    """The machine's clocks."""

    name = "system"

    def read(self) -> ClockReading:
        """CLOCK_REALTIME and CLOCK_MONOTONIC, one right after the other."""
        return ClockReading(realtime_ns=time.time_ns(), monotonic_ns=time.monotonic_ns())

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Sleep; wakes up at once when `stop` is set."""
        stop.wait(max(0, monotonic_ns - time.monotonic_ns()) / _NS_PER_S)


class SimulatedClock:
    """A clock that stands still until somebody waits for it, and then is there at once.

    Parameters
    ----------
    realtime_ns
        What it shows first, UTC; its monotonic side begins at 0.
    """

    name = "simulated"

    def __init__(self, realtime_ns: int) -> None:
        self._start_ns = realtime_ns
        self._elapsed_ns = 0
        self._lock = threading.Lock()

    def read(self) -> ClockReading:
        """Where it stands."""
        with self._lock:
            return ClockReading(realtime_ns=self._start_ns + self._elapsed_ns, monotonic_ns=self._elapsed_ns)

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:  # noqa: ARG002 - it never waits
        """Jump; a time that is past already changes nothing."""
        with self._lock:
            self._elapsed_ns = max(self._elapsed_ns, monotonic_ns)
