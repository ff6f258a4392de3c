"""The camera's thread: gets frames and hands them over, and never waits for the disk while the camera is live.

    connect ──> frames ──> connect again, for ever          CameraError: soon, then less and less often
                      └──> no more pictures, or stop        CameraUnusableError: seldom, for nobody is there to help
                      └──> the end with an error            ReplayError: whoever started the replay is there

The recorder goes on without a camera: what became of it stands in the flight.
"""

from __future__ import annotations

import threading

from camera_drivers.errors import CameraError, CameraUnusableError, ReplayError
from flight_file.reports import CameraStatus
from recorder.back_off import BackOff, Pace
from recorder.drivers import Wiring
from recorder.drops import STOPPED, Drops
from recorder.frame_queue import Arrival, Ended, FrameQueue, Notice
from recorder.signs_of_life import SignsOfLife
from recorder.stop import Stop

NO_MORE_PICTURES = "no more pictures"

SOON = Pace(first_s=1.0, longest_s=30.0)  # a camera needs about 30 s from its switch to its first picture
SELDOM = Pace(first_s=30.0, longest_s=120.0)

_SAY_NS = 2_000_000_000  # how often a rest is a sign of life


class Capture(threading.Thread):
    """Runs a camera until it has no more pictures or is told to stop; then ends the queue, whatever happened.

    It is a daemon thread: a camera that hangs must not keep the process from ending.
    """

    def __init__(self, wiring: Wiring, *, queue: FrameQueue, drops: Drops, signs: SignsOfLife, stop: Stop) -> None:
        super().__init__(name="capture", daemon=True)
        self._wiring = wiring
        self._queue = queue
        self._drops = drops
        self._signs = signs
        self._stop_request = stop
        self._back_off = BackOff()
        self._trouble = ""

    def run(self) -> None:
        """Capture; an unexpected exception goes to stderr with its traceback, and the writer is told."""
        reason, error, crashed = "the camera's thread crashed", None, True
        try:
            reason, crashed = self._capture(), False
        except CameraError as failure:
            reason, error, crashed = f"camera failed: {failure}", failure, False
        finally:
            self._queue.end(Ended(reason, self._wiring.clock.read(), error, crashed))

    def _capture(self) -> str:
        while not self._stop_request.is_requested:
            try:
                self._use_camera()
            except ReplayError:
                raise
            except CameraError as failure:
                self._say_lost(failure)
                self._rest(self._back_off.next_ns(SELDOM if isinstance(failure, CameraUnusableError) else SOON))
            else:
                return self._stop_request.reason or NO_MORE_PICTURES
        return self._stop_request.reason

    def _use_camera(self) -> None:
        self._signs.camera()
        with self._wiring.camera as camera:
            self._say_capturing()
            while (frame := camera.next_frame(self._stop_request.event)) is not None:
                self._signs.camera()
                self._back_off.reset()
                self._hand_over(Arrival(frame, self._wiring.clock.read()))

    def _hand_over(self, arrival: Arrival) -> None:
        if self._wiring.live:
            lost = self._queue.push(arrival)
            if lost:
                self._drops.add_overflow(lost)
        elif not self._queue.put(arrival, self._stop_request.event):
            self._drops.add(STOPPED)

    def _say_capturing(self) -> None:
        if not self._wiring.live:
            return  # the recording of a replay that waits for the disk begins with this already
        identity, failures = self._wiring.camera.identity, self._back_off.failures
        parts = [part for part in (identity.driver, identity.note) if part]
        again = f" (after {failures} failed {'attempt' if failures == 1 else 'attempts'})" if failures else ""
        status = CameraStatus("capturing", ": ".join(parts) + again)
        self._queue.notify(Notice(status, self._wiring.clock.read(), identity))
        self._trouble = ""

    def _say_lost(self, failure: CameraError) -> None:
        # A camera that stays away for hours is news once.
        if str(failure) != self._trouble:
            self._trouble = str(failure)
            self._queue.notify(Notice(CameraStatus("lost", self._trouble), self._wiring.clock.read()))

    def _rest(self, duration_ns: int) -> None:
        clock, stop = self._wiring.clock, self._stop_request.event
        until_ns = clock.read().monotonic_ns + duration_ns
        while not stop.is_set() and (now_ns := clock.read().monotonic_ns) < until_ns:
            self._signs.camera()
            clock.wait_until(min(until_ns, now_ns + _SAY_NS), stop)
