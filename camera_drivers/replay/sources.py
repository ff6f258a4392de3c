"""Sources of a replay, a recorded flight or a folder: pictures in order, each with the time it was taken.

A flight's frames are replayed as they were, with their times, EXIF and gaps. The pictures of a folder come in the order
of their names and of the numbers in them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, pairwise
from pathlib import Path

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import ReplayError
from camera_drivers.exif import exif_time_ns, read_exif
from camera_drivers.photographs import picture_facts, picture_format
from camera_drivers.replay.chapters import counted
from camera_drivers.replay.upcoming import Alongside, Upcoming
from flight_file.documents import is_heif
from flight_file.errors import FlightFileError
from flight_file.frame import JPEG, MAX_TIME_NS, NS_PER_S, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.untrusted import open_regular, read_regular

FLIGHT_SUFFIXES = (".mcap", ".mcap.part")
_CONFIGURATION = "recorder.yaml"  # describes the recorder that made the flight, not this one
PICTURE_SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif", ".avif"})
_GIVE_RATE = "give rate_hz (--rate), the pictures per second."
_HEAD_BYTES = 256 * 1024  # the markers before the picture; EXIF with its thumbnail is at most 64 KiB


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
            time_of_day=session.time_of_day,
            originals=session.originals,
        )

    def pictures(self) -> Iterator[Upcoming]:
        """Iterate over the whole frames, each with positions and sound up to a second later."""
        fixes, sounds = self._flight.fixes(), Alongside(self._flight.heard())
        try:
            waiting = next(fixes, None)
            for frame, following in pairwise(chain(self._flight.frames(), [None])):
                if frame is None:
                    return
                came = []
                while waiting is not None and (
                    following is None or waiting.captured_ns <= frame.captured_ns + NS_PER_S
                ):
                    came.append(waiting)
                    waiting = next(fixes, None)
                heard = sounds.with_picture(frame.captured_ns)
                whole = replace(frame, fixes=tuple(came), sound=heard) if came or heard else frame
                yield Upcoming(frame.captured_ns, partial(_as_it_was, whole))
        except FlightFileError as error:
            raise ReplayError(str(error)) from error


def _as_it_was(frame: Frame, _clock: Clock) -> Frame:
    return frame


class FolderSource:
    """Pictures from a folder; files not named like pictures are ignored and counted.

    Parameters
    ----------
    folder
        Of the pictures.
    rate_hz
        Pictures per second: picture i was taken i / rate_hz after the first one, which was taken when its EXIF says, or
        now. None: each was taken when its own EXIF says.
    clock
        Gives the present time.

    Raises
    ------
    ReplayError
        There is no picture, or one in HEIF, or the EXIF times are needed and do not increase strictly.
    """

    def __init__(self, folder: Path, *, rate_hz: float | None, clock: Clock) -> None:
        paths, ignored = _pictures(folder)
        if not paths:
            raise ReplayError(f"{folder}: there is no picture in it; give a folder of pictures or flight files.")
        self._paths = paths
        self._captured_ns = _exif_times(paths) if rate_hz is None else _paced_times(paths, rate_hz, clock)
        self.start_ns = self._captured_ns[0]
        self.attachments: Mapping[str, bytes] = {}
        self.identity = CameraIdentity(
            driver="replay", note=f"{len(paths)} pictures from a folder, {ignored} other files in it ignored"
        )

    def pictures(self) -> Iterator[Upcoming]:
        """Iterate over the pictures; each file is read when its time has come."""
        for sequence, (path, captured_ns) in enumerate(zip(self._paths, self._captured_ns, strict=True)):
            yield Upcoming(captured_ns, partial(_take, path, sequence, captured_ns))


def _pictures(folder: Path) -> tuple[list[Path], int]:
    try:
        files = sorted((path for path in folder.iterdir() if path.is_file()), key=counted)
    except OSError as error:
        raise ReplayError(f"{folder}: the folder cannot be read ({error.strerror}); check its path.") from error
    pictures = [path for path in files if path.suffix.lower() in PICTURE_SUFFIXES]
    for path in pictures:
        if is_heif(_head(path)):
            raise ReplayError(
                f"{path}: HEIF pictures are not stored; convert all of them first: magick mogrify -format jpg *.HEIC"
            )
    return pictures, len(files) - len(pictures)


def _head(path: Path, size_bytes: int = 12) -> bytes:
    try:
        with os.fdopen(open_regular(path), "rb") as file:
            return file.read(size_bytes)
    except OSError as error:
        raise _unreadable(path, error) from error


def _read(path: Path) -> bytes:
    try:
        return read_regular(path, limit_bytes=MAX_READ_BYTES)
    except OSError as error:
        raise _unreadable(path, error) from error


def _exif_time(path: Path) -> int | None:
    head = _head(path, _HEAD_BYTES)
    if picture_format(head) != JPEG:
        head = _read(path)  # in PNG and WebP it may follow the picture
    time_ns = exif_time_ns(read_exif(picture_facts(head).exif).datetime)
    return time_ns if time_ns is not None and 0 <= time_ns <= MAX_TIME_NS else None  # as a flight file takes it


def _exif_times(paths: Sequence[Path]) -> list[int]:
    times = []
    for path in paths:
        time_ns = _exif_time(path)
        if time_ns is None:
            raise ReplayError(f"{path}: the picture has no EXIF time; {_GIVE_RATE}")
        times.append(time_ns)
    for (before, after), path in zip(pairwise(times), paths[1:], strict=True):
        if after <= before:
            raise ReplayError(f"{path}: its EXIF time is not later than the one of the picture before; {_GIVE_RATE}")
    return times


def _paced_times(paths: Sequence[Path], rate_hz: float, clock: Clock) -> list[int]:
    first = _exif_time(paths[0])
    start_ns = clock.read().realtime_ns if first is None else first
    return [start_ns + round(index * NS_PER_S / rate_hz) for index in range(len(paths))]


def _take(path: Path, sequence: int, captured_ns: int, clock: Clock) -> Frame:
    before = clock.read()
    encoded = _read(path)
    after = clock.read()
    facts = picture_facts(encoded)
    return Frame(
        sequence=sequence,
        captured_ns=captured_ns,
        encoded=encoded,
        sha256=hashlib.sha256(encoded).hexdigest(),
        times=HostTimes(before_request=before, after_answer=after, downloaded=after),
        exif=read_exif(facts.exif),
        width_px=facts.width_px,
        height_px=facts.height_px,
        format=picture_format(encoded),
    )


def _unreadable(path: Path, error: OSError) -> ReplayError:
    return ReplayError(f"{path}: the picture cannot be read ({error.strerror}); check the file and its permissions.")
