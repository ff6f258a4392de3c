"""The pictures that the simulated camera takes: from a folder, from a flight, or drawn; with EXIF as it would write it.

The coded picture is never touched where it is served in its own size: only the EXIF segment is replaced.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from PIL import Image, ImageDraw

from camera_drivers.jpeg import EXIF_PREFIX
from flight_file.documents import SOI, jpeg_segments
from flight_file.reader import open_flight

Source = Callable[[int], bytes]
"""The picture of the shot with this number, which may be any; raises OSError or FlightFileError."""

SMALL_PX = (1616, 1212)  # the camera's "2M"

_APP1 = b"\xff\xe1"
_SUFFIXES = frozenset({".jpg", ".jpeg"})
_DRAWN_PX = (640, 480)


class NoPicturesError(ValueError):
    """No picture to serve was found."""


@dataclass(frozen=True, slots=True)
class Taken:
    """How a picture was taken, for its EXIF."""

    number: int
    at: datetime
    focal_length_mm: float


def open_pictures(path: Path | None) -> Source:
    """Open a folder of JPEGs, a flight file, or, for None, drawn pictures; raises NoPicturesError."""
    if path is None:
        return drawn_picture
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
        if not files:
            raise NoPicturesError(f"{path}: there is no JPEG in it; give another folder, or a flight file.")
        return lambda number: files[number % len(files)].read_bytes()
    frames = [frame.encoded for frame in open_flight([path]).frames()]  # a fixture's; small enough to be kept
    if not frames:
        raise NoPicturesError(f"{path}: there is no picture in it; give another flight file, or a folder.")
    return lambda number: frames[number % len(frames)]


def drawn_picture(number: int) -> bytes:
    """Draw a dial with a needle and the number of the shot."""
    image = Image.new("RGB", _DRAWN_PX, (24, 26, 30))
    draw = ImageDraw.Draw(image)
    draw.ellipse((140, 60, 500, 420), outline=(220, 220, 220), width=4)
    draw.pieslice((160, 80, 480, 400), number * 6, number * 6 + 6, fill=(240, 200, 60))
    draw.text((300, 440), f"{number}", fill=(220, 220, 220))
    buffer = io.BytesIO()
    image.save(buffer, "JPEG", quality=90)
    return buffer.getvalue()


def as_small(jpeg: bytes) -> bytes:
    """Reduce a picture to about two megapixels; a smaller one stays as it is."""
    with Image.open(io.BytesIO(jpeg)) as image:
        if image.width <= SMALL_PX[0] and image.height <= SMALL_PX[1]:
            return jpeg
        image.draft(image.mode, SMALL_PX)
        image.thumbnail(SMALL_PX)
        buffer = io.BytesIO()
        image.save(buffer, "JPEG", quality=90)
    return buffer.getvalue()


def with_exif(jpeg: bytes, taken: Taken) -> bytes:
    """Add the EXIF of a QX10 to a picture; its coded data stays byte for byte."""
    exif = Image.Exif()
    exif.update({0x010F: "SONY", 0x0110: "DSC-QX10", 0x0131: "DSC-QX10 v3.00"})
    exif.get_ifd(0x8769).update(
        {
            0x829A: 0.01,
            0x829D: 3.3,
            0x8827: 200,
            0x9003: f"{taken.at:%Y:%m:%d %H:%M:%S}",
            0x920A: round(taken.focal_length_mm, 2),
            0xA420: f"{taken.number:032x}",  # ImageUniqueID: no two pictures have the same bytes
        }
    )
    content = exif.tobytes()
    segment = _APP1 + (len(content) + 2).to_bytes(2, "big") + content
    bare = without_exif(jpeg)
    return bare[: len(SOI)] + segment + bare[len(SOI) :]


def without_exif(jpeg: bytes) -> bytes:
    """Remove the EXIF segment, if there is one."""
    for marker, start, end in jpeg_segments(jpeg):
        if marker == _APP1[1] and jpeg.startswith(EXIF_PREFIX, start):
            return jpeg[: start - len(_APP1) - 2] + jpeg[end:]
    return jpeg
