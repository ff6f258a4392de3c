"""When a stream's picture was taken: by the camera's clock if that is plausible, else by its arrival.

A camera's sender reports give the time of each picture by its wall clock. That clock is right only if it was set right,
which in an aircraft it often is not. A picture cannot be taken after it arrived, nor longer before than cameras take to
send it: a camera's clock within these limits is trusted, any other is reported with its offset.

| sender reports       | mid-exposure                              | sigma                                            |
| -------------------- | ----------------------------------------- | ------------------------------------------------ |
| that fit             | what they say                             | from there to the arrival, uniform: / sqrt(12)   |
| that do not, or none | the arrival, less half of `latency_s`     | `latency_s` / sqrt(12), which is never less      |

The arrival is that of the fastest picture, transferred to the others by the sender's own timestamps. The trusted clock
may change from one group of pictures to the next, not within one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from camera_drivers.clock import realtime_ns
from camera_drivers.live.delay import Delay
from camera_drivers.waiting import Notes
from flight_file.frame import NS_PER_S, CameraStatus, ClockReading

STATE = "clock"


class _By(Enum):
    """The clock of the pictures' times."""

    REPORTS = "the pictures' times are by the camera's clock, which fits to the box's"
    ARRIVAL_DESPITE_REPORTS = "the camera's clock does not fit to the box's; the pictures' times are by their arrival"
    ARRIVAL = "the camera sends no reports of its clock; the pictures' times are by their arrival"


@dataclass(frozen=True, slots=True)
class Stamps:
    """The known times of an access unit.

    Attributes
    ----------
    reported_ns
        By the camera's wall clock; None if there is no sender report.
    stream_ns
        By the stream's own timestamps, from an arbitrary start; None if it has none.
    arrived
        The box's clocks when it began to arrive.
    """

    reported_ns: int | None
    stream_ns: int | None
    arrived: ClockReading


@dataclass(frozen=True, slots=True)
class _Group:
    """The reference picture of a group's times: mid-exposure (realtime), sigma, and stream time, all ns."""

    taken_ns: int
    sigma_ns: int
    stream_ns: int


class StreamTimes:
    """The times of one connection's pictures.

    Parameters
    ----------
    latency_s
        How long the camera may take from exposure to sending.
    """

    def __init__(self, latency_s: float, notes: Notes) -> None:
        self._latency_ns = round(latency_s * NS_PER_S)
        self._notes = notes
        self._by: _By | None = None
        self._delays = {True: Delay(), False: Delay()}
        self._group: _Group | None = None

    def hear(self, stamps: Stamps) -> None:
        """Learn the delay of pictures; called for each, as soon as it has arrived."""
        self._sent_ns(stamps)

    def taken(self, stamps: Stamps, *, is_key: bool) -> tuple[int, int]:
        """Estimate a picture's mid-exposure, realtime, and its standard deviation, ns.

        Within a group of pictures only the stream's own timestamps are used, so that what is learned of clocks
        meanwhile does not change the order.
        """
        group = None if is_key else self._group
        if group is not None and stamps.stream_ns is not None:
            return group.taken_ns + stamps.stream_ns - group.stream_ns, group.sigma_ns
        taken_ns, sigma_ns = self._estimate(stamps)
        self._group = None if stamps.stream_ns is None else _Group(taken_ns, sigma_ns, stamps.stream_ns)
        return taken_ns, sigma_ns

    def _estimate(self, stamps: Stamps) -> tuple[int, int]:
        sent_ns, reported_ns = self._sent_ns(stamps), stamps.reported_ns
        if reported_ns is not None and 0 <= sent_ns - reported_ns <= self._latency_ns:
            self._say(_By.REPORTS, reported_ns - sent_ns)
            return reported_ns, round((sent_ns - reported_ns) / math.sqrt(12))
        if reported_ns is None:
            self._say(_By.ARRIVAL, None)
        else:
            self._say(_By.ARRIVAL_DESPITE_REPORTS, reported_ns - sent_ns)
        return sent_ns - self._latency_ns // 2, round(self._latency_ns / math.sqrt(12))

    def _sent_ns(self, stamps: Stamps) -> int:
        """Estimate when it would have arrived without delay, realtime."""
        shown_ns = stamps.stream_ns if stamps.reported_ns is None else stamps.reported_ns
        if shown_ns is None:
            return stamps.arrived.realtime_ns
        delay = self._delays[stamps.reported_ns is not None]
        return realtime_ns(delay.taken_ns(shown_ns, stamps.arrived.monotonic_ns), stamps.arrived)

    def _say(self, by: _By, ahead_ns: int | None) -> None:
        if by is self._by:
            return
        self._by = by
        # The camera's clock is ahead by that much plus the time the picture took to get here.
        offset_ns = None if ahead_ns is None else ahead_ns + self._latency_ns // 2
        sigma_ns = None if ahead_ns is None else round(self._latency_ns / math.sqrt(12))
        self._notes.report(
            CameraStatus(STATE, by.value, camera_clock_offset_ns=offset_ns, camera_clock_sigma_ns=sigma_ns)
        )
