"""Where the set-up page's pictures come from, a flight or a single picture; each is cached while there is room.

`panel` is the picture that an opened panel was drawn on, `frame-N` a picture of the flight.
"""

from __future__ import annotations

import re
import shlex
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.pictures import ColourPicture, GreyPicture, decompressed, grey_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.panel.errors import PictureError
from decoder.setup.thresholds import KEPT_BYTES
from flight_file.documents import is_heif
from flight_file.errors import FlightFileError
from flight_file.reader import Flight, open_flight, spread
from flight_file.scan import is_video
from flight_file.segment import opened
from flight_file.thresholds import BLOCK_BYTES, MAX_READ_BYTES
from flight_file.untrusted import read_regular

SAMPLE_FRAMES = 20
FLIGHT_ENDINGS = (".mcap", ".mcap.part")

PANEL_KEY = "panel"
_KEY = re.compile(r"frame-(\d{1,9})")

Decompress = Callable[[bytes], NDArray[np.uint8]]


class PictureSource(Protocol):
    """Pictures of one cockpit, counted from 0."""

    @property
    def name(self) -> str:
        """What a person would call it."""
        ...

    @property
    def count(self) -> int:
        """How many pictures there are."""
        ...

    @property
    def sample(self) -> tuple[int, ...]:
        """Some of them, spread evenly."""
        ...

    def encoded(self, index: int) -> bytes:
        """Return one picture as it was recorded; PictureError if it is unavailable."""
        ...

    def focal_length_mm(self, index: int) -> float | None:
        """Return the zoom of a picture that was read before, if known."""
        ...


class FlightSource:
    """The frames of a flight, each read on demand."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.name = flight.recording
        self.count = flight.count()
        self._video = GroupDecoder()
        self.sample = tuple(sorted(spread(self.count, SAMPLE_FRAMES)))
        self._focal_lengths_mm: dict[int, float | None] = {}

    def encoded(self, index: int) -> bytes:
        """Return one frame's picture as it was recorded; from a video, as a JPEG."""
        for frame in self.flight.shown(range(index, index + 1)):
            self._focal_lengths_mm[index] = frame.exif.lens_mm
            encoded = encoded_of(frame)
            return encoded if isinstance(encoded, bytes) else self._video.jpeg(encoded)
        raise PictureError(f"frame {index} cannot be read; choose another")

    def focal_length_mm(self, index: int) -> float | None:
        """Return a frame's zoom, from its EXIF."""
        return self._focal_lengths_mm.get(index)


class SinglePicture:
    """One picture in a file."""

    count = 1
    sample = (0,)

    def __init__(self, path: Path) -> None:
        self.name = path.name
        try:
            self._encoded = read_regular(path, limit_bytes=MAX_READ_BYTES)
        except IsADirectoryError as error:
            command = shlex.join(["recorder", "replay", str(path), "-o", f"{path.resolve().name}.mcap"])
            raise PictureError(
                f"{path}: is a directory; name a flight or a picture in it, or make a flight of its photographs:"
                f" {command}"
            ) from error
        except OSError as error:
            raise PictureError(f"{path} cannot be read: {error.strerror}") from error
        try:
            grey_picture(self._encoded)
        except PictureError as error:
            if is_heif(self._encoded):
                raise PictureError(f"{path}: {error}") from error
            raise PictureError(f"{path}: neither a flight file nor a picture; name a flight or a JPEG") from error

    def encoded(self, index: int) -> bytes:
        """Return the picture; 0 is the only one."""
        if index:
            raise PictureError("there is only one picture")
        return self._encoded

    def focal_length_mm(self, index: int) -> float | None:  # noqa: ARG002 - as of a flight
        """Return None: the panel's own zoom is assumed."""
        return None


def open_source(paths: Sequence[Path]) -> FlightSource | SinglePicture:
    """Open the segments of one recording, or one picture.

    Raises
    ------
    PictureError
        If it is neither a flight nor a picture.
    FlightFileError
        If it is a flight file that cannot be read.
    """
    if len(paths) == 1 and not paths[0].name.endswith(FLIGHT_ENDINGS) and not _is_video(paths[0]):
        return SinglePicture(paths[0])
    source = FlightSource(open_flight(paths))
    if not source.count:
        raise PictureError(f"{paths[0]}: holds no pictures to draw a panel on")
    return source


def _is_video(path: Path) -> bool:
    """Whether it is a video file, for which opening it as a flight says what to do first; not if it is unreadable."""
    with suppress(FlightFileError), opened(path) as source:
        return is_video(source.read_at(0, BLOCK_BYTES))
    return False


class PictureStore:
    """Encoded, grey and coloured pictures by key; thread-safe."""

    def __init__(self, source: PictureSource, panel_picture: bytes | None) -> None:
        self.source = source
        self._panel_picture = panel_picture
        self._kept: OrderedDict[tuple[str, int], NDArray[np.uint8]] = OrderedDict()
        self._lock = threading.Lock()

    def encoded(self, key: str) -> bytes:
        """Read a picture as it was recorded.

        Raises
        ------
        PictureError
            If there is none under that key.
        """
        if key == PANEL_KEY and self._panel_picture is not None:
            return self._panel_picture
        match = _KEY.fullmatch(key)
        if match is None or int(match[1]) >= self.source.count:
            raise PictureError("there is no such picture")
        with self._lock:
            return self.source.encoded(int(match[1]))

    def grey(self, key: str) -> GreyPicture:
        """(H, W) uint8: the luma, as the decoder sees it."""
        return self._keep((key, cv2.IMREAD_GRAYSCALE), grey_picture)

    def colour(self, key: str, shrink: int = 1) -> ColourPicture:
        """(H, W, 3) uint8 BGR: for people to look at; shrunk by 2, 4 or 8 during decompression."""
        flags = {
            1: cv2.IMREAD_COLOR,
            2: cv2.IMREAD_REDUCED_COLOR_2,
            4: cv2.IMREAD_REDUCED_COLOR_4,
            8: cv2.IMREAD_REDUCED_COLOR_8,
        }[shrink]
        return self._keep((key, flags), lambda encoded: decompressed(encoded, flags))

    def forget_colours(self, but: str) -> None:
        """Drop the coloured pictures of all keys but one."""
        with self._lock:
            for key in [each for each in self._kept if each[0] != but and each[1] != cv2.IMREAD_GRAYSCALE]:
                del self._kept[key]

    def _keep(self, key: tuple[str, int], make: Decompress) -> NDArray[np.uint8]:
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make(self.encoded(key[0]))
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > 1 and sum(each.nbytes for each in self._kept.values()) > KEPT_BYTES:
                self._kept.popitem(last=False)
        return made
