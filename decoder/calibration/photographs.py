"""Photographs to calibrate with, or frames of a flight file: their grey, and the focal length in their EXIF."""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from decoder.calibration.thresholds import MOST_PIXELS
from decoder.imaging.pictures import GreyPicture, grey_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.panel.errors import CalibrationError, PictureError
from flight_file.frame import is_focal_length_mm
from flight_file.reader import open_flight
from flight_file.records import MAGIC
from flight_file.scan import is_video
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.untrusted import read_regular

_LOOKED_AT = 120  # frames of a flight: a board held in thirty positions, for a few seconds each
_HEAD_BYTES = 16
_EXIF_IFD, _FOCAL_LENGTH, _MODEL = 0x8769, 0x920A, 0x0110
_DAMAGE = (SyntaxError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, OSError, struct.error)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """One photograph: its file name, (H, W) grey, the focal length in mm, and the camera's model if known."""

    name: str
    grey: GreyPicture
    focal_length_mm: float
    model: str

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        height, width = self.grey.shape
        return width, height


def read_photographs(
    paths: Sequence[Path], otherwise_mm: float | None, tell: Callable[[str], None]
) -> Iterator[Photograph]:
    """Read photographs one after the other, and frames spread over each flight file.

    Parameters
    ----------
    paths : of pictures and of flight files
    otherwise_mm : the focal length if a picture does not give it
    tell : gets a sentence for each flight file with frames left out, or parts lost

    Raises
    ------
    CalibrationError
        As `read_photograph`, or if no frame of a flight file can be read.
    FlightFileError
        If a flight file cannot be read.
    """
    for path in paths:
        if _is_flight(path):
            yield from _frames(path, otherwise_mm, tell)
        else:
            yield read_photograph(path, otherwise_mm)


def _is_flight(path: Path) -> bool:
    """Whether it is a flight file, or a video, for which `open_flight` says what to do."""
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError:
        return False  # `read_photograph` says why
    return head.startswith(MAGIC) or is_video(head)


def _frames(path: Path, otherwise_mm: float | None, tell: Callable[[str], None]) -> Iterator[Photograph]:
    """Read about `_LOOKED_AT` frames, evenly spread, without damaged ones."""
    flight, video = open_flight([path]), GroupDecoder()
    count, read, damaged = flight.count(), 0, 0
    for frame in flight.shown(range(0, count, count // _LOOKED_AT or 1)):
        name = f"{path}, frame {frame.sequence}"
        try:
            grey = grey_picture(encoded_of(frame), video)
        except PictureError:
            damaged += 1
            continue
        read += 1
        yield _photograph(name, grey, frame.exif.lens_mm or otherwise_mm, "")
    if not read:
        raise CalibrationError(f"{path}: holds no frame that can be read; film the board again")
    if damaged:
        tell(f"{path}: {damaged} of {damaged + read} frames are damaged, and left out")
    for loss in flight.losses:
        tell(f"lost: {loss}")


def read_photograph(path: Path, otherwise_mm: float | None = None) -> Photograph:
    """Read a photograph with its focal length; `otherwise_mm` if its EXIF does not say.

    Raises
    ------
    CalibrationError
        If it cannot be read, or does not say its focal length.
    """
    try:
        encoded = read_regular(path, limit_bytes=MAX_READ_BYTES)
        grey = grey_picture(encoded)
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except PictureError as error:
        raise CalibrationError(f"{path}: {error}; take another photograph") from error
    focal_length_mm, model = _tags(encoded)
    return _photograph(str(path), grey, focal_length_mm or otherwise_mm, model)


def _photograph(name: str, grey: GreyPicture, focal_length_mm: float | None, model: str) -> Photograph:
    if grey.size > MOST_PIXELS:
        height, width = grey.shape
        raise CalibrationError(
            f"{name}: is {width} x {height}; calibrate with photographs of {MOST_PIXELS // 10**6} million pixels or"
            " fewer, as the camera takes them at a smaller picture size"
        )
    if focal_length_mm is None:
        raise CalibrationError(f"{name}: says no focal length; use the camera's own file, or give focal_length_mm")
    return Photograph(Path(name).name, grey, focal_length_mm, model)


def same_size(sizes_px: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    """Check that all photographs, by name, have one width and height.

    Raises
    ------
    CalibrationError
        If they differ.
    """
    first, size = next(iter(sizes_px.items()))
    for other, its in sizes_px.items():
        if its != size:
            raise CalibrationError(
                f"{other} is {its[0]} x {its[1]}, {first} is {size[0]} x {size[1]};"
                " calibrate with photographs of one size"
            )
    return size


def _tags(encoded: bytes) -> tuple[float | None, str]:
    try:
        with warnings.catch_warnings(), Image.open(io.BytesIO(encoded)) as picture:
            warnings.simplefilter("ignore")  # Pillow warns of truncated blocks, but a missing tag is enough to know
            exif = picture.getexif()
            length, model = exif.get_ifd(_EXIF_IFD).get(_FOCAL_LENGTH), exif.get(_MODEL)
            value = float(length) if length is not None else 0.0
    except _DAMAGE:
        return None, ""
    return (value if is_focal_length_mm(value) else None), model.strip("\x00 ") if isinstance(model, str) else ""
