"""Pictures as grey arrays: the one place where pictures are decompressed, always the same way.

A gauge whose needle is visible in colour only is read in another grey, a mixture of the colours around it or an
extreme of them; a frame's colours are decompressed only if needed for that.

Grey is the JPEG's own luma plane, which saves the colour conversion. It differs by up to five levels from the grey of
the decoded colours, so frames, panel pictures and templates must all come through here. EXIF orientation is ignored,
because a camera that senses it would turn its frames in flight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.video import Encoded, GroupDecoder, GroupPicture
from decoder.panel.errors import PictureError
from flight_file.documents import is_heif, picture_header

GreyPicture = NDArray[np.uint8]
ColourPicture = NDArray[np.uint8]
Coloured = Callable[[], ColourPicture]
"""Gives a picture in colour, (H, W, 3), red, green, blue; it may lie in memory that the next one takes."""

WHITE = 255


@dataclass(frozen=True, slots=True, eq=False)
class FramePicture:
    """A frame's grey levels, the focal length at which it was taken, if known, and a way to see it in colour."""

    pixels: GreyPicture
    focal_length_mm: float | None = None
    coloured: Coloured | None = None

    def in_colour(self) -> ColourPicture:
        """Return it in colour; a frame without colours in its greys."""
        return self.coloured() if self.coloured else without_colour(self.pixels)

    @property
    def height_px(self) -> int:
        """How many rows it has."""
        return len(self.pixels)


def without_colour(pixels: GreyPicture) -> ColourPicture:
    """(H, W, 3): a grey picture as a colour one."""
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB), np.uint8)


@dataclass(frozen=True, slots=True)
class Mixture:
    """A grey made of a picture's colours, each with a factor of 1, -1 or 0."""

    red: int
    green: int
    blue: int

    @property
    def parts(self) -> NDArray[np.float64]:
        """(3,): the weight of each colour, scaled so that no picture leaves the range of grey levels."""
        counts = np.array([self.red, self.green, self.blue], np.float64)
        parts: NDArray[np.float64] = counts / np.abs(counts).sum()
        return parts

    def of(self, colour: ColourPicture) -> GreyPicture:
        """(H, W) uint8: the grey of a picture (H, W, 3)."""
        parts = self.parts
        lowest = WHITE * float(parts[parts < 0.0].sum())
        return np.asarray(cv2.transform(colour, np.array([[*parts, -lowest]])), np.uint8)

    def levels(self, colours: NDArray[Any]) -> NDArray[Any]:
        """(...): the grey of colours (..., 3), without the offset that keeps those of a picture positive."""
        return np.asarray(colours @ self.parts.astype(np.float32))

    def __str__(self) -> str:
        """Name its colours, such as red and green minus blue."""
        counts = {"red": self.red, "green": self.green, "blue": self.blue}
        added, taken = (" and ".join(name for name, count in counts.items() if count == sign) for sign in (1, -1))
        return f"{added} minus {taken}" if taken else added


class Extreme(Enum):
    """A grey that at each pixel is its brightest colour, or its darkest.

    Whatever is lit, in any colour, is brighter in one than what is not; whatever is printed on white is darker in the
    other. A mixture of colours may hide one that only some frames show.
    """

    BRIGHTEST = "brightest"
    DARKEST = "darkest"

    def of(self, colour: ColourPicture) -> GreyPicture:
        """(H, W) uint8: the grey of a picture (H, W, 3)."""
        return np.asarray(self.levels(colour), np.uint8)

    def levels(self, colours: NDArray[Any]) -> NDArray[Any]:
        """(...): the grey of colours (..., 3)."""
        return np.asarray(colours.max(axis=-1) if self is Extreme.BRIGHTEST else colours.min(axis=-1))

    def __str__(self) -> str:
        return f"each pixel's {self.value} colour"


Mixed = Mixture | Extreme
"""What a gauge is sampled in instead of luma."""


def grey_picture(encoded: Encoded, video: GroupDecoder | None = None) -> GreyPicture:
    """Decompress a picture's luma.

    Parameters
    ----------
    encoded : a file's bytes, or a picture of a video
    video : the decoder that decoded the video's earlier pictures, if there are several

    Returns
    -------
    (H, W) uint8

    Raises
    ------
    PictureError
        As `decompressed`.
    """
    if isinstance(encoded, GroupPicture):
        return (video or GroupDecoder()).grey(encoded)
    return decompressed(encoded, cv2.IMREAD_GRAYSCALE)


def decompressed(encoded: bytes, flags: int) -> NDArray[np.uint8]:
    """(H, W) or (H, W, 3) uint8: decompress a JPEG, PNG or WebP with OpenCV and these flags of its own.

    Raises
    ------
    PictureError
        If the bytes are none of these, are truncated, or would take more memory or time than a picture may.
    """
    if not encoded:
        raise PictureError("the picture is empty")
    header = picture_header(encoded)
    if is_heif(encoded):
        raise PictureError("the picture is in HEIF; convert it to a JPEG: magick picture.heic picture.jpg")
    if header is None:
        raise PictureError("the picture is damaged, or neither a JPEG nor a PNG nor a WebP; save it as one of these")
    objection = header.objection(len(encoded))
    if objection:
        raise PictureError(objection)
    try:
        picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise PictureError("the picture cannot be decompressed") from error
    if picture is None:
        raise PictureError("the picture is damaged or cut short")
    return np.asarray(picture, np.uint8)


def colour_picture(encoded: Encoded, video: GroupDecoder | None = None) -> ColourPicture:
    """Decompress a picture in colour, for people to look at, and for gauges whose needles show in colour only.

    Parameters
    ----------
    encoded, video : as in `grey_picture`

    Returns
    -------
    (H, W, 3) uint8, red, green, blue

    Raises
    ------
    PictureError
        As `decompressed`.
    """
    if isinstance(encoded, GroupPicture):
        return (video or GroupDecoder()).colour(encoded)
    picture = decompressed(encoded, cv2.IMREAD_COLOR)
    cv2.cvtColor(picture, cv2.COLOR_BGR2RGB, picture)
    return picture
