"""What the recorder expects of every camera."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from flight_file.frame import Frame
from flight_file.session import Original


@dataclass(frozen=True, slots=True)
class CameraIdentity:
    """Which camera it is; empty where it does not say.

    Attributes
    ----------
    note
        What else is worth a line in the flight, in words.
    time_of_day, originals
        As in a flight's session: the clock of its pictures' times, and the video files that they come from.
    """

    driver: str
    model: str = ""
    serial: str = ""
    note: str = ""
    time_of_day: str = ""
    originals: tuple[Original, ...] = ()


class Camera(Protocol):
    """A camera, or a substitute for one.

    Entering the context connects to it, leaving it disconnects; both may raise CameraError. One thread at a time uses
    it.
    """

    @property
    def identity(self) -> CameraIdentity:
        """Which camera it is, as far as is known."""
        ...

    def __enter__(self) -> Self:
        """Connect."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Disconnect."""
        ...

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """Wait for the next picture; return None if there are no more, or soon after `stop` is set.

        Raises
        ------
        CameraError
            If no picture can be obtained.
        """
        ...
