"""The camera's thread: gets frames and hands them over, and never waits for the disk while the camera is live."""

from __future__ import annotations

import threading
from collections import Counter

from camera_drivers.errors import CameraError
from recorder.drivers import Wiring
from recorder.frame_queue import Arrival, Ended, FrameQueue
from recorder.stop import Stop

QUEUE_FULL = "the disk is slower than the camera"
STOPPED = "stopped before there was room to store it"
NO_MORE_PICTURES = "no more pictures"


class Drops:
    """Frames that were taken but not stored, counted by reason; used by both threads."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()

    def add(self, reason: str) -> None:
        """One more."""
        with self._lock:
            self._counts[reason] += 1

    def by_reason(self) -> dict[str, int]:
        """All so far."""
        with self._lock:
            return dict(self._counts)


class Capture(threading.Thread):
    """Runs a camera until it has no more pictures, fails, or is told to stop; then ends the queue, whatever happened.

    It is a daemon thread: a camera that hangs must not keep the process from ending.
    """

    def __init__(self, wiring: Wiring, queue: FrameQueue, drops: Drops, stop: Stop) -> None:
        super().__init__(name="capture", daemon=True)
        self._wiring = wiring
        self._queue = queue
        self._drops = drops
        self._stop_request = stop

    def run(self) -> None:
        """Capture; an unexpected exception goes to stderr with its traceback, and the writer is told."""
        reason, error, crashed = "the camera's thread crashed", None, True
        try:
            with self._wiring.camera as camera:
                while (frame := camera.next_frame(self._stop_request.event)) is not None:
                    self._hand_over(Arrival(frame, self._wiring.clock.read()))
            reason, crashed = self._stop_request.reason or NO_MORE_PICTURES, False
        except CameraError as failure:
            reason, error, crashed = f"camera failed: {failure}", failure, False
        finally:
            self._queue.end(Ended(reason, self._wiring.clock.read(), error, crashed))

    def _hand_over(self, arrival: Arrival) -> None:
        if not self._wiring.live:
            if not self._queue.put(arrival, self._stop_request.event):
                self._drops.add(STOPPED)
        elif not self._queue.offer(arrival):
            self._drops.add(QUEUE_FULL)
