"""The camera's clock: its offset to the box's clock, and whether it has been set.

The camera has no call that reads its clock. The offset is known from setting it, and from the times in its pictures,
which are whole seconds. Each gives an interval for the offset; their intersection is narrower. An interval that does
not overlap the rest means that a clock was set, the camera's or the box's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.reporter import Reporter
from camera_drivers.waiting import Notes
from flight_file.frame import NS_PER_S, CameraStatus

STATE = "clock"

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Interval:
    """Bounds of the clock's offset, ns; camera minus box."""

    low_ns: int
    high_ns: int

    @property
    def middle_ns(self) -> int:
        """The best estimate."""
        return (self.low_ns + self.high_ns) // 2

    @property
    def sigma_ns(self) -> int:
        """The standard deviation, assuming a uniform distribution."""
        return round((self.high_ns - self.low_ns) / math.sqrt(12))

    def common(self, other: Interval) -> Interval | None:
        """Intersect two intervals; None if they do not overlap."""
        low, high = max(self.low_ns, other.low_ns), min(self.high_ns, other.high_ns)
        return Interval(low, high) if low <= high else None


class CameraClock:
    """Estimates the offset of one camera's clock."""

    def __init__(self, clock: Clock, reporter: Reporter) -> None:
        self._clock = clock
        self._reporter = reporter
        self.offset: Interval | None = None

    def set(self, api: RemoteApi, notes: Notes) -> None:
        """Set the camera's clock to UTC.

        Raises
        ------
        CameraUnreachableError
            The camera cannot be reached any more.
        """
        before = self._clock.read()
        second = before.realtime_ns // NS_PER_S
        text = f"{_EPOCH + timedelta(seconds=second):%Y-%m-%dT%H:%M:%SZ}"
        setting = {"dateTime": text, "timeZoneOffsetMinute": 0, "dstOffsetMinute": 0}
        try:
            api.call("setCurrentTime", setting, service="system")
        except CameraRefusedError as error:
            notes.say_once(STATE, f"the camera does not let its clock be set (error {error.code})")
            return
        except CameraSilentError as error:
            notes.say_once(STATE, f"whether the camera's clock was set is not known: {error.problem}")
            return
        after = self._clock.read()
        took_ns = after.monotonic_ns - before.monotonic_ns
        set_ns = second * NS_PER_S
        self.offset = Interval(set_ns - before.realtime_ns - took_ns, set_ns - before.realtime_ns)
        self._report("the camera's clock was set", self.offset)

    def compare(self, shown_ns: int, earliest_ns: int, latest_ns: int) -> None:
        """Compare with a time in a picture.

        Parameters
        ----------
        shown_ns
            The whole second that the picture shows, by the camera's clock.
        earliest_ns, latest_ns
            Times by the box's clock, realtime, between which the camera wrote it.
        """
        seen = Interval(shown_ns - latest_ns, shown_ns + NS_PER_S - earliest_ns)
        if self.offset is None:
            self.offset = seen
            self._report("the camera's clock shows in its pictures", seen)
            return
        common = self.offset.common(seen)
        if common is None:
            self._report("a clock was set, the camera's or the box's", seen)
        self.offset = common or seen

    def _report(self, reason: str, offset: Interval) -> None:
        self._reporter.report(
            CameraStatus(STATE, reason, camera_clock_offset_ns=offset.middle_ns, camera_clock_sigma_ns=offset.sigma_ns)
        )
