"""The bounded queue between the camera's thread and the writer's, and the count of frames that were dropped."""

from __future__ import annotations

import threading
from collections import Counter, deque
from dataclasses import dataclass

from camera_drivers.camera import CameraIdentity
from flight_file.frame import CameraStatus, ClockReading, Frame
from recorder.thresholds import LOOK_S, QUEUE_BYTES, QUEUE_FRAMES, WAITING_LINES

QUEUE_FULL = "the disk is slower than the camera"
DELETED = "somebody deleted the unfinished file that they were in"
STOPPED = "stopped before there was room to store it"
NO_MEMORY = "no memory was left for it"


class Drops:
    """Counts dropped frames by reason, for all threads."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._disk_trouble = ""

    def add(self, reason: str, count: int = 1) -> None:
        """Count this many more."""
        with self._lock:
            self._counts[reason] += count

    def add_overflow(self, count: int) -> None:
        """Count frames that found no room in the queue, because the disk failed or is too slow."""
        self.add(self._disk_trouble or QUEUE_FULL, count)

    def blame_disk(self, trouble: str) -> None:
        """Set the reason for further overflows; empty when the disk works again."""
        self._disk_trouble = trouble

    def by_reason(self) -> dict[str, int]:
        """Copy the counts by reason."""
        with self._lock:
            return dict(self._counts)

    @property
    def total(self) -> int:
        """All dropped frames so far."""
        with self._lock:
            return self._counts.total()


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame, and the recorder's clocks when it had arrived."""

    frame: Frame
    at: ClockReading


@dataclass(frozen=True, slots=True)
class Notice:
    """News of the camera between its frames; `identity` if it has just said who it is."""

    status: CameraStatus
    at: ClockReading
    identity: CameraIdentity | None = None


@dataclass(frozen=True, slots=True)
class Ended:
    """The end of the frames.

    `reason` goes into the end record; `error` is what ended it, if it was an expected failure; `crashed` if the
    camera's thread died of something unexpected, whose traceback is on stderr.
    """

    reason: str
    at: ClockReading
    error: Exception | None = None
    crashed: bool = False


Item = Arrival | Notice | Ended


class FrameQueue:
    """First in, first out; limited in frames, bytes of JPEG, and notices.

    One frame always fits, however large, and the end is never refused.
    """

    def __init__(self, capacity: int = QUEUE_FRAMES, capacity_bytes: int = QUEUE_BYTES) -> None:
        self._capacity = capacity
        self._capacity_bytes = capacity_bytes
        self._items: deque[Item] = deque()
        self._frames = 0
        self._bytes = 0
        self._lost_notices = 0
        self._changed = threading.Condition()

    def __len__(self) -> int:
        """Count the frames waiting."""
        with self._changed:
            return self._frames

    def push(self, arrival: Arrival) -> int:
        """Put a frame, dropping the oldest ones to make room; return how many were dropped."""
        lost = 0
        with self._changed:
            while self._is_full_for(arrival):
                self._remove_oldest(Arrival)
                lost += 1
            self._put(arrival)
        return lost

    def put(self, arrival: Arrival, stop: threading.Event) -> bool:
        """Put a frame, waiting for room; return False if `stop` was set first."""
        with self._changed:
            while self._is_full_for(arrival):
                if stop.is_set():
                    return False
                self._changed.wait(LOOK_S)
            self._put(arrival)
            return True

    def notify(self, notice: Notice) -> None:
        """Put a notice; the oldest one goes, and is counted, if there are too many."""
        with self._changed:
            if len(self._items) - self._frames >= WAITING_LINES:
                self._remove_oldest(Notice)
                self._lost_notices += 1
            self._put(notice)

    def end(self, ended: Ended) -> None:
        """Put the end, which is never refused."""
        with self._changed:
            self._put(ended)

    def take(self, timeout_s: float) -> Item | None:
        """Take the oldest item; None if nothing came in time."""
        with self._changed:
            if not self._items:
                self._changed.wait(timeout_s)
            if not self._items:
                return None
            item = self._items[0]
            self._remove(0)
            self._changed.notify_all()
            return item

    def take_lost_notices(self) -> int:
        """Return how many notices were dropped since the last call."""
        with self._changed:
            lost, self._lost_notices = self._lost_notices, 0
            return lost

    def _is_full_for(self, arrival: Arrival) -> bool:
        if not self._frames:
            return False
        return self._frames >= self._capacity or self._bytes + _size_bytes(arrival) > self._capacity_bytes

    def _put(self, item: Item) -> None:
        self._items.append(item)
        self._frames += isinstance(item, Arrival)
        self._bytes += _size_bytes(item)
        self._changed.notify_all()

    def _remove_oldest(self, kind: type[Item]) -> None:
        self._remove(next(index for index, item in enumerate(self._items) if isinstance(item, kind)))

    def _remove(self, index: int) -> None:
        item = self._items[index]
        del self._items[index]
        self._frames -= isinstance(item, Arrival)
        self._bytes -= _size_bytes(item)


def _size_bytes(item: Item) -> int:
    return len(item.frame.encoded) if isinstance(item, Arrival) else 0
