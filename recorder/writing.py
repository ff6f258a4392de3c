"""The writer's thread: takes frames and news of the camera from the queue, in order, and has them stored.

It is a thread of its own, so that a disk that hangs cannot keep the process from hearing a signal.
"""

from __future__ import annotations

import threading

from flight_file.errors import FlightNotWrittenError
from recorder.drivers import Wiring
from recorder.errors import RecorderError
from recorder.frame_queue import Arrival, Ended, FrameQueue, Item, Notice
from recorder.recording import Recording
from recorder.signs_of_life import SignsOfLife
from recorder.stop import Stop
from recorder.store import Store

IDLE_S = 1.0  # how long to wait for a frame before looking at the clock
FIRST_WORD_S = 5.0  # how long the first segment waits for the camera to say who it is
PATIENCE_S = 3.0  # how long a camera may take to notice that it shall stop

_RETRY_NS = 250_000_000


class Writing(threading.Thread):
    """Stores everything until the queue ends; it is a daemon thread, since the disk may hang.

    Attributes
    ----------
    done
        Set when it is over; then `result` gives how, or raises.
    """

    def __init__(
        self,
        recording: Recording,
        store: Store,
        *,
        queue: FrameQueue,
        wiring: Wiring,
        stop: Stop,
        signs: SignsOfLife,
    ) -> None:
        super().__init__(name="writer", daemon=True)
        self._recording = recording
        self._store = store
        self._queue = queue
        self._wiring = wiring
        self._stop_request = stop
        self._signs = signs
        self._patience_s = PATIENCE_S
        self._ended: Ended | None = None
        self._failure: FlightNotWrittenError | None = None
        self.done = threading.Event()

    def run(self) -> None:
        """Store; an unexpected exception goes to stderr with its traceback."""
        try:
            first = self._first_word() if self._wiring.live else None
            ended = self._until_end(first)
            self._recording.finish(ended.reason, ended.at)
            self._ended = ended
        except FlightNotWrittenError as failure:
            self._failure = failure
        finally:
            if self._ended is None:
                self._stop_request.request("the disk failed")
                self._store.abandon()
            self.done.set()

    def result(self) -> Ended:
        """How the recording ended.

        Raises
        ------
        FlightNotWrittenError
            The disk failed.
        RecorderError
            The thread crashed.
        """
        if self._failure is not None:
            raise self._failure
        if self._ended is None:
            raise RecorderError("The writer's thread crashed; its traceback is above, please report it.")
        return self._ended

    def _first_word(self) -> Item | None:
        # Every segment says which camera it is from. A frame never waits for that: it is the first word itself.
        waited_s = 0.0
        while waited_s < FIRST_WORD_S and not self._stop_request.is_requested:
            self._signs.disk()
            item = self._queue.take(IDLE_S)
            if item is not None:
                return item
            waited_s += IDLE_S
        return None

    def _until_end(self, item: Item | None) -> Ended:
        while True:
            self._signs.disk()
            if not self._has_open_segment():
                continue
            if item is None:
                item = self._queue.take(IDLE_S)
            self._recording.say_lost_notices(self._queue.take_lost_notices())
            ended = item if isinstance(item, Ended) else self._handle(item)
            if ended is not None:
                return ended
            item = None

    def _handle(self, item: Arrival | Notice | None) -> Ended | None:
        if isinstance(item, Arrival):
            self._recording.store(item)
        elif isinstance(item, Notice):
            self._recording.note(item)
        else:
            return self._idle()
        return None

    def _idle(self) -> Ended | None:
        now = self._wiring.clock.read()
        if self._wiring.live:
            self._recording.tick(now)
        if self._stop_request.is_requested:
            self._patience_s -= IDLE_S
            if self._patience_s <= 0:
                return Ended(f"{self._stop_request.reason}; the camera did not answer", now)
        return None

    def _has_open_segment(self) -> bool:
        clock = self._wiring.clock
        if self._store.is_open or self._store.open(clock.read()):
            return True
        if self._stop_request.is_requested:
            if not self._store.try_now(clock.read()) and self._store.trouble is not None:
                raise self._store.trouble.failure
        else:
            clock.wait_until(clock.read().monotonic_ns + _RETRY_NS, self._stop_request.event)
        return False
