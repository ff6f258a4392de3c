"""A recorded flight: its frames come again as they were, with their times, EXIF and gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import ReplayError
from camera_drivers.replay.source import Upcoming
from flight_file.errors import FlightFileError
from flight_file.frame import Frame
from flight_file.reader import open_flight

FLIGHT_SUFFIXES = (".mcap", ".mcap.part")

_CONFIGURATION = "recorder.yaml"  # describes the recorder that made the flight, not the one that replays it


class FlightSource:
    """The frames of a flight; host times stay those of the recorder that took them.

    Raises
    ------
    ReplayError
        The files cannot be opened as one flight, or no frame of it is whole.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        try:
            self._flight = open_flight(paths)
            first = next(self._flight.frames(), None)
        except FlightFileError as error:
            raise ReplayError(str(error)) from error
        if first is None:
            raise ReplayError(f"{paths[0]}: no picture in it is whole; there is nothing to replay.")
        self.start_ns = first.captured_ns
        self.attachments: Mapping[str, bytes] = {
            name: content for name, content in self._flight.attachments.items() if name != _CONFIGURATION
        }
        session = self._flight.session
        self.identity = CameraIdentity(
            driver="replay",
            model=session.camera_model,
            serial=session.camera_serial,
            note=f"the recording {session.recording}",
        )

    @property
    def losses(self) -> int:
        """What could not be read so far; the frames concerned are gaps in the replay."""
        return len(self._flight.losses)

    def pictures(self) -> Iterator[Upcoming]:
        """All frames that are whole."""
        try:
            for frame in self._flight.frames():
                yield Upcoming(frame.captured_ns, _AsItWas(frame))
        except FlightFileError as error:
            raise ReplayError(str(error)) from error


class _AsItWas:
    """Gives a frame that is there already."""

    __slots__ = ("_frame",)

    def __init__(self, frame: Frame) -> None:
        self._frame = frame

    def __call__(self, _clock: Clock) -> Frame:
        return self._frame
