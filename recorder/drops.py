"""Frames that were taken but not stored, counted by reason."""

from __future__ import annotations

import threading
from collections import Counter

QUEUE_FULL = "the disk is slower than the camera"
STOPPED = "stopped before there was room to store it"


class Drops:
    """The count; used by all threads."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._disk_trouble = ""

    def add(self, reason: str, count: int = 1) -> None:
        """So many more."""
        with self._lock:
            self._counts[reason] += count

    def add_overflow(self, count: int) -> None:
        """So many found no room in the queue: for the disk's trouble if it has any, else because it is slow."""
        self.add(self._disk_trouble or QUEUE_FULL, count)

    def blame_disk(self, trouble: str) -> None:
        """From now on this is why there is no room; empty when it is over."""
        self._disk_trouble = trouble

    def by_reason(self) -> dict[str, int]:
        """All so far."""
        with self._lock:
            return dict(self._counts)

    @property
    def total(self) -> int:
        """All so far."""
        with self._lock:
            return self._counts.total()
