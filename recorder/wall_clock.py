"""Notices when somebody sets the wall clock: the realtime clock then leaves the monotonic one behind, or falls back.

A clock that is merely slewed (by at most 0.05 %, the kernel's limit) is not set. A machine that slept looks as if its
clock had been set forward by the time it slept.
"""

from __future__ import annotations

from flight_file.frame import ClockReading

LEAST_JUMP_NS = 20_000_000  # two clocks are read one after the other: a busy machine needs a moment between them
SLEWING = 1 / 1000


class WallClock:
    """Compares each reading with the one before."""

    def __init__(self) -> None:
        self._last: ClockReading | None = None

    def jump_ns(self, at: ClockReading) -> int:
        """By how much the wall clock was set since the last reading, ns; 0 if it was not."""
        last, self._last = self._last, at
        if last is None:
            return 0
        passed_ns = at.monotonic_ns - last.monotonic_ns
        jump_ns = at.realtime_ns - last.realtime_ns - passed_ns
        return jump_ns if abs(jump_ns) > LEAST_JUMP_NS + SLEWING * abs(passed_ns) else 0


def in_words(jump_ns: int) -> str:
    """`the wall clock was set forward by 3.200 s`."""
    way = "forward" if jump_ns > 0 else "back"
    return f"the wall clock was set {way} by {abs(jump_ns) / 1e9:.3f} s"
