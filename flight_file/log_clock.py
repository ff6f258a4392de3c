"""Log times of a recording: they follow the monotonic clock, and never run back, whatever is done to the wall clock.

Each segment is anchored where the wall clock stands when it begins, so that a clock that was set right during a
recording is right from the next segment on. Only a clock that was set back is not followed: log times go on from where
they were. What the clocks said themselves stands in every message.
"""

from __future__ import annotations

from flight_file import moments
from flight_file.frame import ClockReading


class LogClock:
    """The log times of one recording, over all its segments."""

    def __init__(self) -> None:
        self._anchor: ClockReading | None = None
        self._last_ns = 0

    def begin_segment(self, at: ClockReading) -> None:
        """Follow the wall clock from here on, unless it has been set back."""
        ahead_ns = at.realtime_ns if self._anchor is None else max(at.realtime_ns, self._unbounded(self._anchor, at))
        self._anchor = ClockReading(realtime_ns=ahead_ns, monotonic_ns=at.monotonic_ns)

    def time_ns(self, at: ClockReading) -> int:
        """The log time of what happened then; never less than the one before."""
        anchor = self._anchor or at
        self._last_ns = max(self._last_ns, moments.storable(self._unbounded(anchor, at)))
        return self._last_ns

    @staticmethod
    def _unbounded(anchor: ClockReading, at: ClockReading) -> int:
        return anchor.realtime_ns + at.monotonic_ns - anchor.monotonic_ns
