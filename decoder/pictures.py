"""Pictures as grey arrays: the one place where JPEGs are decompressed, always the same way.

Grey is the JPEG's own luma plane, which saves the colour conversion; it differs by up to five levels from the grey of
the decoded colours, so frames, panel pictures and templates must all come through here. EXIF orientation is never
obeyed: a camera that senses it would turn its frames in flight.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.errors import PictureError
from decoder.jpeg_header import jpeg_header

GreyPicture = NDArray[np.uint8]
ColourPicture = NDArray[np.uint8]
_FLAGS = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True, eq=False)
class FramePicture:
    """A frame's grey levels, and the focal length at which it was taken, if it tells."""

    pixels: GreyPicture
    focal_length_mm: float | None = None

    @property
    def height_px(self) -> int:
        """How many rows it has."""
        return len(self.pixels)


def grey_picture(encoded: bytes) -> GreyPicture:
    """The picture's luma.

    Parameters
    ----------
    encoded : JPEG (or PNG) bytes

    Returns
    -------
    (H, W) uint8

    Raises
    ------
    PictureError
        If the bytes are no picture, or one that breaks off.
    """
    return _decompressed(encoded, _FLAGS)


def _decompressed(encoded: bytes, flags: int) -> NDArray[np.uint8]:
    if not encoded:
        raise PictureError("the picture is empty")
    header = jpeg_header(encoded)
    if header is not None and not header.fits(len(encoded)):
        raise PictureError(
            f"the picture is damaged or cut short: it says that it is {header.width_px} x {header.height_px}, which its"
            f" {len(encoded)} bytes cannot hold"
        )
    try:
        picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags)
    except cv2.error as error:
        raise PictureError("the picture cannot be decompressed") from error
    if picture is None:
        raise PictureError("the picture is damaged or cut short")
    return np.asarray(picture, np.uint8)


def colour_picture(encoded: bytes) -> ColourPicture:
    """The picture in colour, for people to look at; nothing is ever read from it.

    Parameters
    ----------
    encoded : JPEG (or PNG) bytes

    Returns
    -------
    (H, W, 3) uint8, red, green, blue

    Raises
    ------
    PictureError
        If the bytes are no picture, or one that breaks off.
    """
    return np.ascontiguousarray(_decompressed(encoded, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)[..., ::-1])
