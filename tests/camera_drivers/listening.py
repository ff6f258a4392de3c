"""Who hears what a driver says beside its pictures, takes these as the recorder does, and a machine without files."""

from __future__ import annotations

import resource
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from camera_drivers.camera import Camera
from camera_drivers.errors import CameraError
from flight_file.frame import CameraStatus, Frame

CONNECTIONS = 20  # nothing in these tests takes longer than that many attempts


@dataclass
class Listener:
    """A reporter that remembers."""

    reports: list[CameraStatus] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    waits: list[str] = field(default_factory=list)

    def report(self, status: CameraStatus) -> None:
        """Remember it."""
        self.reports.append(status)

    def lost(self, reason: str) -> None:
        """Remember it."""
        self.losses.append(reason)

    def waiting(self, reason: str) -> None:
        """Remember it."""
        self.waits.append(reason)

    def reasons(self, state: str) -> list[str]:
        """What was reported under a state."""
        return [status.reason for status in self.reports if status.state == state]


def taken_by_and_by(camera: Camera, number: int, failures: list[str]) -> list[Frame]:
    """So many frames; the camera is connected again as the recorder does it."""
    frames: list[Frame] = []
    while len(frames) < number:
        try:
            with camera:
                while len(frames) < number:
                    frame = camera.next_frame(threading.Event())
                    assert frame is not None
                    frames.append(frame)
        except CameraError as error:
            failures.append(str(error))
            assert len(failures) < CONNECTIONS, failures
            threading.Event().wait(0.1)
    return frames


@contextmanager
def no_more_files() -> Iterator[None]:
    """A machine on which this process can open no more files."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
