"""The simulated camera's own clock: some offset away from the machine's, and set by a call."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from camera_drivers.clock import Clock

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_NS_PER_S = 1_000_000_000


class CameraTime:
    """What the camera believes the time to be.

    Parameters
    ----------
    clock
        The machine's.
    offset_s
        By how much it is ahead of that.
    """

    def __init__(self, clock: Clock, offset_s: float) -> None:
        self._clock = clock
        self._offset_ns = round(offset_s * _NS_PER_S)

    def now(self) -> datetime:
        """The time on it; as on the camera, its zone is not told."""
        return _EPOCH + timedelta(microseconds=(self._clock.read().realtime_ns + self._offset_ns) // 1000)

    def turn(self, seconds: float) -> None:
        """Set it ahead by so much, or behind."""
        self._offset_ns += round(seconds * _NS_PER_S)

    def set(self, told: Mapping[str, Any]) -> None:
        """Set it as `setCurrentTime` tells; LookupError, TypeError or ValueError where that is no time."""
        shown = datetime.strptime(told["dateTime"], "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)
        zone = timedelta(minutes=told["timeZoneOffsetMinute"] + told["dstOffsetMinute"])
        set_ns = (shown + zone - _EPOCH) // timedelta(microseconds=1) * 1000
        self._offset_ns = set_ns - self._clock.read().realtime_ns
