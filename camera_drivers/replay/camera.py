"""The replay driver: pictures come at their own pace, by the clock that is passed in.

A clock that really waits replays a flight as it was; one that jumps replays it as fast as the disk allows. The driver
cannot tell.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import ReplayError
from camera_drivers.replay.sources import FLIGHT_SUFFIXES, FlightSource, FolderSource
from camera_drivers.replay.upcoming import ReplaySource, Upcoming
from camera_drivers.replay.video_clocks import Believed
from flight_file.frame import Frame
from flight_file.records import MAGIC
from flight_file.untrusted import open_regular


def open_source(
    paths: Sequence[Path],
    *,
    rate_hz: float | None,
    clock: Clock,
    believed: Believed | None = None,
    keep_sound: bool = False,
) -> ReplaySource:
    """Open what is to be replayed.

    Parameters
    ----------
    paths
        One folder of JPEGs, one folder of flight files, flight files, or the video files of one recording.
    rate_hz
        Pictures per second, for a folder of JPEGs only.
    clock
        Says what now is, for pictures without any time.
    believed
        Stated time of a video; for video files only.
    keep_sound
        Whether a video's sound is stored as it is; for video files only. Its strongest tones always are.

    Raises
    ------
    ReplayError
        Nothing there can be replayed, or it lacks something that was asked for.
    """
    if not paths:
        raise ReplayError("There is nothing to replay; give a folder of pictures or flight files.")
    try:
        folders = [path for path in paths if path.is_dir()]
        if not folders and not any(map(is_flight, paths)):
            return _video(paths, rate_hz, believed or Believed(), keep_sound=keep_sound)
        if believed not in (None, Believed()):
            raise ReplayError(f"{paths[0]}: is no video; --start, --clock and --utc-offset are for videos.")
        if keep_sound:
            raise ReplayError(f"{paths[0]}: is no video; --keep-sound is for videos.")
        if not folders:
            return _flight(paths, rate_hz)
        if len(paths) > 1:
            raise ReplayError(f"{folders[0]}: a folder is replayed alone; give one folder, or only flight files.")
        flights = sorted(path for path in folders[0].iterdir() if path.name.endswith(FLIGHT_SUFFIXES))
    except FileNotFoundError as error:
        raise ReplayError(f"{error.filename}: there is no such file; check its name.") from error
    except OSError as error:
        raise ReplayError(f"{paths[0]}: cannot be looked at ({error.strerror}); check its name.") from error
    return _flight(flights, rate_hz) if flights else FolderSource(folders[0], rate_hz=rate_hz, clock=clock)


def _flight(paths: Sequence[Path], rate_hz: float | None) -> FlightSource:
    if rate_hz is not None:
        raise ReplayError(f"{paths[0]}: a flight keeps its own times; leave rate_hz out.")
    return FlightSource(paths)


def is_flight(path: Path) -> bool:
    """Whether it is a flight file by its name or its first bytes."""
    if path.name.endswith(FLIGHT_SUFFIXES):
        return True
    with os.fdopen(open_regular(path), "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _video(paths: Sequence[Path], rate_hz: float | None, believed: Believed, *, keep_sound: bool) -> ReplaySource:
    if rate_hz is not None:
        raise ReplayError(f"{paths[0]}: a video keeps its own times; leave rate_hz (--rate) out.")
    try:
        from camera_drivers.replay.video import VideoSource  # noqa: PLC0415 - FFmpeg, which the box need not have
    except ImportError as error:
        raise ReplayError(
            f"{paths[0]}: video files need PyAV; install it: pip install 'image-flight-recorder[video]'"
        ) from error
    return VideoSource(paths, believed, keep_sound=keep_sound)


class ReplayCamera:
    """A camera that shows earlier pictures.

    Parameters
    ----------
    source
        What there is to replay.
    clock
        Sets the pace. The first picture comes at once, the others as much later as they were taken later.
    """

    def __init__(self, source: ReplaySource, clock: Clock) -> None:
        self._source = source
        self._clock = clock
        self._pictures: Iterator[Upcoming] = iter(())
        self._opened_ns = 0

    @property
    def identity(self) -> CameraIdentity:
        """The camera that took the pictures, as far as known."""
        return self._source.identity

    def __enter__(self) -> Self:
        """Begin with the first picture."""
        self._pictures = self._source.pictures()
        self._opened_ns = self._clock.read().monotonic_ns
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Start over at the next connection."""
        self._pictures = iter(())

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """Wait for the next picture's time and return it; None after the last, or once `stop` is set.

        Raises
        ------
        ReplayError
            The picture cannot be read.
        """
        try:
            upcoming = next(self._pictures, None)
            if upcoming is None or stop.is_set():
                return None
            self._clock.wait_until(self._opened_ns + upcoming.captured_ns - self._source.start_ns, stop)
            return None if stop.is_set() else upcoming.take(self._clock)
        except MemoryError:  # another connection would begin with the first picture again
            raise ReplayError("No memory is left for the next picture; end other programs.") from None
