"""What a camera driver says beside its pictures, on its way to the flight: the recorder's `Reporter`."""

from __future__ import annotations

from camera_drivers.clock import Clock
from flight_file.reports import CameraStatus
from recorder.drops import Drops
from recorder.frame_queue import FrameQueue, Notice
from recorder.signs_of_life import SignsOfLife


class CameraReports:
    """Hands the reports to the writer's thread, in order with the frames; see `camera_drivers.reporter.Reporter`."""

    def __init__(self, *, queue: FrameQueue, drops: Drops, signs: SignsOfLife, clock: Clock) -> None:
        self._queue = queue
        self._drops = drops
        self._signs = signs
        self._clock = clock

    def report(self, status: CameraStatus) -> None:
        """Will stand in the flight."""
        self._signs.camera()
        self._queue.notify(Notice(status, self._clock.read()))

    def lost(self, reason: str) -> None:
        """Counts as a drop with this reason."""
        self._signs.camera()
        self._drops.add(reason)

    def waiting(self, reason: str) -> None:  # noqa: ARG002 - the watchdog does not care why
        """Feeds the watchdog."""
        self._signs.camera()
