"""Helpers for tests and fixtures: a machine that is always the same, a clock and a camera that are worked by hand."""

from __future__ import annotations

import hashlib
import queue
import threading
from types import TracebackType
from typing import Self

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError
from flight_file.frame import Frame, HostTimes
from recorder.clock import SimulatedClock
from recorder.host import Host


class ManualClock(SimulatedClock):
    """A clock that moves only when it is told to, or when somebody waits for it."""

    def advance(self, duration_ns: int) -> None:
        """Turn both sides forward."""
        with self._lock:
            self._elapsed_ns += duration_ns

    def set_realtime(self, realtime_ns: int) -> None:
        """Set the wall clock, as an operator or NTP would; the monotonic side does not notice."""
        with self._lock:
            self._start_ns = realtime_ns - self._elapsed_ns


def fixed_host(clock: Clock) -> Host:
    """A machine that leaves no trace in a flight: the same recording made twice gives the same bytes."""
    return Host(
        clock=clock, name="", boot_id="", versions={}, free_bytes=lambda _path: None, temperatures_c=dict[str, float]
    )


class PuppetCamera:
    """A live camera that gives the pictures and the failures that it is given, in order, and waits in between.

    Attributes
    ----------
    shown, connections
        Pictures given so far; how often it was connected.
    """

    identity = CameraIdentity(driver="puppet", model="P-1", serial="7")

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._script: queue.SimpleQueue[bytes | CameraError] = queue.SimpleQueue()
        self.shown = 0
        self.connections = 0

    def show(self, *jpegs: bytes) -> None:
        """Pictures to give."""
        for jpeg in jpegs:
            self._script.put(jpeg)

    def fail(self, error: CameraError) -> None:
        """A failure to raise from the next call."""
        self._script.put(error)

    def __enter__(self) -> Self:
        """Connect."""
        self.connections += 1
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Disconnect."""

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """What comes next."""
        while not stop.is_set():
            try:
                given = self._script.get(timeout=0.02)
            except queue.Empty:
                continue
            if isinstance(given, CameraError):
                raise given
            return self._frame(given)
        return None

    def _frame(self, jpeg: bytes) -> Frame:
        at = self._clock.read()
        sequence, self.shown = self.shown, self.shown + 1
        return Frame(sequence, at.realtime_ns, jpeg, hashlib.sha256(jpeg).hexdigest(), HostTimes(at, at, at))
