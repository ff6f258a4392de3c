"""Helpers for tests and fixtures: a machine that is always the same, and a clock that is turned by hand."""

from __future__ import annotations

from camera_drivers.clock import Clock
from recorder.clock import SimulatedClock
from recorder.host import Host


class ManualClock(SimulatedClock):
    """A clock that moves only when it is told to, or when somebody waits for it."""

    def advance(self, duration_ns: int) -> None:
        """Turn both sides forward."""
        with self._lock:
            self._elapsed_ns += duration_ns

    def set_realtime(self, realtime_ns: int) -> None:
        """Set the wall clock, as an operator or NTP would; the monotonic side does not notice."""
        with self._lock:
            self._start_ns = realtime_ns - self._elapsed_ns


def fixed_host(clock: Clock) -> Host:
    """A machine that leaves no trace in a flight: the same recording made twice gives the same bytes."""
    return Host(
        clock=clock, name="", boot_id="", versions={}, free_bytes=lambda _path: None, temperatures_c=dict[str, float]
    )
