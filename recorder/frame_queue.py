"""The bounded queue between the camera's thread and the writer's."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

from flight_file.frame import ClockReading, Frame

QUEUE_BYTES = 24 * 2**20  # four 18-megapixel pictures: as much as a small board can spare
QUEUE_FRAMES = 64  # small pictures: what waits longer than this many shows that the disk cannot follow

_LOOK_S = 0.2  # how often a waiting producer looks whether it shall stop


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame, and the recorder's clocks when it was there."""

    frame: Frame
    at: ClockReading


@dataclass(frozen=True, slots=True)
class Ended:
    """No more frames will come.

    `reason` stands in the end record; `error` is what ended it, if it was an expected failure; `crashed` if the
    camera's thread died of something unexpected, whose traceback is on stderr.
    """

    reason: str
    at: ClockReading
    error: Exception | None = None
    crashed: bool = False


class FrameQueue:
    """First in, first out; full at so many frames or bytes of JPEG.

    One frame always fits, however large, and the end is never refused.
    """

    def __init__(self, capacity: int = QUEUE_FRAMES, capacity_bytes: int = QUEUE_BYTES) -> None:
        self._capacity = capacity
        self._capacity_bytes = capacity_bytes
        self._items: deque[Arrival | Ended] = deque()
        self._bytes = 0
        self._changed = threading.Condition()

    def __len__(self) -> int:
        with self._changed:
            return len(self._items)

    def offer(self, arrival: Arrival) -> bool:
        """Put a frame if there is room; says whether there was."""
        with self._changed:
            if self._is_full_for(arrival):
                return False
            self._put(arrival)
            return True

    def put(self, arrival: Arrival, stop: threading.Event) -> bool:
        """Put a frame, waiting for room; False if `stop` was set before there was any."""
        with self._changed:
            while self._is_full_for(arrival):
                if stop.is_set():
                    return False
                self._changed.wait(_LOOK_S)
            self._put(arrival)
            return True

    def end(self, ended: Ended) -> None:
        """Say that no more will come."""
        with self._changed:
            self._put(ended)

    def take(self, timeout_s: float) -> Arrival | Ended | None:
        """The oldest; None if nothing came in time."""
        with self._changed:
            if not self._items:
                self._changed.wait(timeout_s)
            if not self._items:
                return None
            item = self._items.popleft()
            self._bytes -= _size_bytes(item)
            self._changed.notify_all()
            return item

    def _is_full_for(self, arrival: Arrival) -> bool:
        if not self._items:
            return False
        return len(self._items) >= self._capacity or self._bytes + _size_bytes(arrival) > self._capacity_bytes

    def _put(self, item: Arrival | Ended) -> None:
        self._items.append(item)
        self._bytes += _size_bytes(item)
        self._changed.notify_all()


def _size_bytes(item: Arrival | Ended) -> int:
    return len(item.frame.jpeg) if isinstance(item, Arrival) else 0
