"""Photographs to calibrate with: their grey, and the focal length in their EXIF."""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from decoder.calibration.thresholds import MOST_PIXELS
from decoder.imaging.pictures import GreyPicture, grey_picture
from decoder.panel.errors import CalibrationError, PictureError
from flight_file.frame import is_focal_length_mm
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.untrusted import read_regular

_EXIF_IFD, _FOCAL_LENGTH, _MODEL = 0x8769, 0x920A, 0x0110
_DAMAGE = (SyntaxError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, OSError, struct.error)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """One photograph: its file's name, (H, W) grey, the focal length in mm, the camera's model if it says."""

    name: str
    grey: GreyPicture
    focal_length_mm: float
    model: str

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        height, width = self.grey.shape
        return width, height


def read_photograph(path: Path) -> Photograph:
    """Read a photograph with its focal length.

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
    if grey.size > MOST_PIXELS:
        height, width = grey.shape
        raise CalibrationError(
            f"{path}: is {width} x {height}; calibrate with photographs of {MOST_PIXELS // 10**6} million pixels or"
            " fewer, as the camera takes them at a smaller picture size"
        )
    focal_length_mm, model = _tags(encoded)
    if focal_length_mm is None:
        raise CalibrationError(
            f"{path}: its EXIF says no focal length; use the camera's own file, or give focal_length_mm in a YAML file"
        )
    return Photograph(path.name, grey, focal_length_mm, model)


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
            warnings.simplefilter("ignore")  # Pillow warns of truncated blocks; a lacking tag says it already
            exif = picture.getexif()
            length, model = exif.get_ifd(_EXIF_IFD).get(_FOCAL_LENGTH), exif.get(_MODEL)
            value = float(length) if length is not None else 0.0
    except _DAMAGE:
        return None, ""
    return (value if is_focal_length_mm(value) else None), model.strip("\x00 ") if isinstance(model, str) else ""
