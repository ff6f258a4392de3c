"""The driver of any live camera: enter, frames, and an error as soon as it has to be connected again.

                     ┌───────────────── CameraError: the user closes it and enters again ◀──────────────────┐
                     ▼                                                                                       │
    away ──enter──▶ connected ──picture──▶ moving? ──yes──▶ due? ──yes──▶ frame                              │
                     │  ▲                    │                └──no──▶ next picture                          │
                     │  └────────────────────┼──────────────────────────────┘                               │
                     └──none for stall_s─────┴──frozen──────────────────────────────────────────────────────┘

How a picture gets here is up to the source. The count of frames continues over all connections; a lost picture leaves a
gap in it. Between two pictures the driver looks for a stop ten times a second, whatever the camera does.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraSilentError
from camera_drivers.exif import read_exif
from camera_drivers.jpeg import jpeg_facts
from camera_drivers.live.frozen import FrozenWatch
from camera_drivers.live.source import Missed, Picture, Source
from camera_drivers.reporter import Reporter
from camera_drivers.settings import LiveSettings
from camera_drivers.thresholds import LOOK_S, SAY_S
from camera_drivers.waiting import Notes, Waiter
from flight_file.frame import JPEG, NS_PER_S, Exif, Frame, HostTimes

Connect = Callable[[Waiter, Notes, Missed], Source]


class LiveCamera:
    """A `Camera` made from the source that `connect` opens.

    Parameters
    ----------
    driver
        Name in recorder.yaml.
    connect
        Opens the source; raises CameraError. Its waits are reported, its notes go into the flight once, and its losses
        are counted.
    clock
        The box's clock, which must really wait.
    reporter
        Hears what happens beside the pictures.
    interval_s
        From one kept picture to the next; 0 keeps all. Pictures between are not stored and not counted as lost.
    """

    def __init__(
        self,
        driver: str,
        connect: Connect,
        options: LiveSettings,
        clock: Clock,
        reporter: Reporter,
        *,
        interval_s: float = 0.0,
    ) -> None:
        self._connect = connect
        self._stall_s = options.stall_s
        self._interval_ns = round(interval_s * NS_PER_S)
        self._clock = clock
        self._reporter = reporter
        self._notes = Notes(reporter)
        self._frozen = FrozenWatch(options.frozen_s, self._notes)
        self._source: Source | None = None
        self._trouble: CameraError | None = None
        self._missed = Missed()
        self._sequence = 0
        self._due_ns: int | None = None
        self._heard_ns = 0
        self._said_ns = 0
        self.identity = CameraIdentity(driver)

    def __enter__(self) -> Self:
        """Connect and begin to receive.

        Raises
        ------
        CameraError
            The camera cannot be found or reached.
        CameraUnusableError
            The configuration cannot be used.
        """
        self._source = self._connect(Waiter(self._clock, self._reporter), self._notes, self._missed)
        try:
            self._begin(self._source)
        except BaseException:
            self._source.close()
            self._source = None
            raise
        return self

    def _begin(self, source: Source) -> None:
        self._trouble = None
        self._frozen.begin()
        self.identity = source.identity
        self._heard_ns = self._said_ns = self._now_ns()
        self._notes.say("connected", f"{self.identity.model or 'a camera'}: {self.identity.note}")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Release the camera."""
        source, self._source = self._source, None
        if source is not None:
            source.close()
            self._count_missed(self._now_ns())

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """Wait for the next picture to be kept; return None soon after `stop` is set.

        Raises
        ------
        CameraError
            The camera has to be connected again.
        """
        if self._source is None:
            raise CameraError("The camera is not connected; enter it first.")
        self._raise_trouble()
        while not stop.is_set():
            picture = self._source.next_picture(LOOK_S)
            now_ns = self._now_ns()
            self._say_waiting(now_ns)
            alive = self._count_missed(now_ns)
            if alive or picture is not None:
                self._heard_ns = now_ns
            if picture is None:
                self._refuse_stall(now_ns)
                continue
            sha256 = hashlib.sha256(picture.encoded).hexdigest()
            self._trouble = self._frozen.look((sha256, picture.number), now_ns, self._sequence)
            if self._is_due(picture):
                return self._frame(picture, sha256)
            self._raise_trouble()
        return None

    def _raise_trouble(self) -> None:
        """Raise the error found together with a picture that had to be returned first."""
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble

    def _refuse_stall(self, now_ns: int) -> None:
        if now_ns - self._heard_ns >= self._stall_s * NS_PER_S:
            problem = f"no picture for {self._stall_s:g} s"
            raise CameraSilentError(self.identity.driver, problem)

    def _say_waiting(self, now_ns: int) -> None:
        if now_ns - self._said_ns >= SAY_S * NS_PER_S:
            self._said_ns = now_ns
            self._reporter.waiting("the next picture is not there yet, or not due")

    def _count_missed(self, now_ns: int) -> bool:
        """Count the lost pictures that would have been kept; return whether they show that the camera works.

        A picture that was not due yet is no loss.
        """
        missed, alive = self._missed.take()
        left = sum(missed.values())
        if self._due_ns is not None:
            left = min(left, max(now_ns - self._due_ns, 0) // self._interval_ns)
        for reason, count in missed.items():
            lost = min(count, left)
            for _ in range(lost):
                self._reporter.lost(reason)
            self._sequence += lost
            left -= lost
        return alive

    def _is_due(self, picture: Picture) -> bool:
        """Whether a picture is due: they are at equal intervals, and a missed one is not made up for."""
        if not self._interval_ns:
            return True
        at_ns = picture.received.monotonic_ns
        due_ns = at_ns if self._due_ns is None else self._due_ns
        if at_ns < due_ns:
            return False
        passed = (at_ns - due_ns) // self._interval_ns
        self._due_ns = due_ns + (passed + 1) * self._interval_ns
        return True

    def _frame(self, picture: Picture, sha256: str) -> Frame:
        sequence, self._sequence = self._sequence, self._sequence + 1
        exif, size_px = Exif(), picture.size_px
        if picture.format == JPEG:
            facts = jpeg_facts(picture.encoded)
            exif = read_exif(facts.exif)
            size_px = (facts.width_px, facts.height_px) if facts.width_px and facts.height_px else None
        width_px, height_px = size_px or (None, None)
        return Frame(
            sequence=sequence,
            captured_ns=picture.taken_ns,
            encoded=picture.encoded,
            sha256=sha256,
            times=HostTimes(picture.received, picture.received, picture.received),
            exif=picture.exif(exif),
            width_px=width_px,
            height_px=height_px,
            captured_sigma_ns=picture.sigma_ns,
            format=picture.format,
        )

    def _now_ns(self) -> int:
        return self._clock.read().monotonic_ns
