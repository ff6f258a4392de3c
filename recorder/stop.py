"""Asking the recorder to stop, with the reason that will stand in the end record."""

from __future__ import annotations

import threading


class Stop:
    """A request to stop; may be made from any thread or signal handler. The first reason counts."""

    def __init__(self) -> None:
        self.event = threading.Event()
        self.reason = ""

    def request(self, reason: str) -> None:
        """Ask to stop."""
        if not self.event.is_set():
            self.reason = reason
            self.event.set()

    @property
    def is_requested(self) -> bool:
        """Whether somebody asked."""
        return self.event.is_set()
