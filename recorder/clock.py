"""Clocks: the machine's, and one that jumps instead of waiting."""

from __future__ import annotations

import threading
import time

from camera_drivers.clock import Clock
from camera_drivers.reporter import Reporter
from flight_file.frame import ClockReading

_NS_PER_S = 1_000_000_000
_TRIES = 3
_CLOSE_NS = 1_000_000  # between two readings of the clock; more means that another thread came in between
_SAY_NS = 5 * _NS_PER_S


class SystemClock:
    """The machine's clocks."""

    name = "system"

    def read(self) -> ClockReading:
        """CLOCK_REALTIME and CLOCK_MONOTONIC at the same moment, to a millisecond, unless the machine is very busy."""
        for _ in range(_TRIES):
            before_ns = time.monotonic_ns()
            realtime_ns = time.time_ns()
            took_ns = time.monotonic_ns() - before_ns
            if took_ns < _CLOSE_NS:
                break
        return ClockReading(realtime_ns=realtime_ns, monotonic_ns=before_ns + took_ns // 2)

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Sleep; wakes up at once when `stop` is set."""
        stop.wait(max(0, monotonic_ns - time.monotonic_ns()) / _NS_PER_S)


class AudibleClock:
    """Another clock, for a driver that does nothing but wait: says every few seconds that it does."""

    def __init__(self, clock: Clock, reporter: Reporter) -> None:
        self._clock = clock
        self._reporter = reporter

    def read(self) -> ClockReading:
        """What the other shows."""
        return self._clock.read()

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Wait as the other does."""
        while not stop.is_set() and (now_ns := self._clock.read().monotonic_ns) < monotonic_ns:
            self._reporter.waiting("the next picture is not due yet")
            self._clock.wait_until(min(monotonic_ns, now_ns + _SAY_NS), stop)


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
