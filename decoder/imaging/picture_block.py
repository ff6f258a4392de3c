"""Memory for the pictures of a batch, reused for the next one: fresh memory costs a third of a decompression.

A sequential JPEG can be decompressed from the top only as far as needed, at correspondingly less cost: the rows below
the panel are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import simplejpeg

from decoder.imaging.pictures import (
    Coloured,
    ColourPicture,
    FramePicture,
    GreyPicture,
    colour_picture,
    grey_picture,
    without_colour,
)
from decoder.imaging.thresholds import MAX_BATCH_FRAMES, MAX_BATCH_PIXELS
from decoder.imaging.video import Encoded, GroupDecoder, GroupPicture
from flight_file.documents import picture_header

ROWS_OF_BLOCKS = 16


@dataclass(frozen=True, slots=True, eq=False)
class TopOfFrame:
    """The first rows of a frame that has `height_px` of them; `whole` decompresses all, and may raise PictureError."""

    pixels: GreyPicture
    height_px: int
    focal_length_mm: float | None
    whole: Callable[[], FramePicture]
    coloured: Coloured | None = None

    def in_colour(self) -> ColourPicture:
        """Return its first rows in colour, or more of them."""
        return self.coloured() if self.coloured else without_colour(self.pixels)


def top_of(picture: FramePicture | TopOfFrame, rows: int | None) -> FramePicture | TopOfFrame:
    """Do as `PictureBlock.frame` for a frame of which some rows are already decompressed.

    Raises
    ------
    PictureError
        As `PictureBlock.frame`, if more rows are needed.
    """
    wanted = picture.height_px if rows is None else rows
    if isinstance(picture, TopOfFrame):
        if wanted > len(picture.pixels):
            return picture.whole()
        return replace(picture, pixels=picture.pixels[:wanted])
    if wanted >= picture.height_px:
        return picture
    top = picture.pixels[:wanted]
    return TopOfFrame(top, picture.height_px, picture.focal_length_mm, lambda: picture, picture.coloured)


def coloured_by(encoded: Encoded, video: GroupDecoder) -> Coloured:
    """Return a function that decodes a picture in colour, as `PictureBlock` does, in memory of its own.

    A picture of a video is the one that was decoded last.

    Raises
    ------
    PictureError
        As `GroupDecoder.picture`.
    """
    if isinstance(encoded, GroupPicture):
        return video.coloured(encoded)
    return lambda: PictureBlock().colour_picture(encoded)


class PictureBlock:
    """Decompresses pictures into memory of its own; each stays until the next is put into the same slot.

    Slots are contiguous: the system provides large memory in large pages, at a fifth of the cost of many small ones.
    """

    def __init__(self) -> None:
        self._memory = np.empty((1, 0), np.uint8)
        self._colours = np.empty(0, np.uint8)
        self._jpeg = bytearray()
        self._video = GroupDecoder()

    def reserve(self, slots: int) -> None:
        """Allocate room for this many pictures at once, instead of one by one."""
        if slots > len(self._memory):
            room = self._memory.shape[1]
            self._memory = np.empty((slots, room if slots * room <= MAX_BATCH_PIXELS else 0), np.uint8)

    def grey_picture(self, encoded: Encoded, slot: int) -> GreyPicture:
        """Do `pictures.grey_picture`, bit for bit.

        Raises
        ------
        PictureError
            If the bytes are not a picture, or a truncated one.
        """
        if isinstance(encoded, GroupPicture):
            return self._video.grey(encoded, self._slot(slot, self._video.size_px(encoded)))
        header = picture_header(encoded)
        if header is None or header.objection(len(encoded)):
            return grey_picture(encoded)  # decides about unusual pictures
        try:
            buffer = self._slot(slot, header.height_px * header.width_px)
            picture = simplejpeg.decode_jpeg(encoded, "GRAY", buffer=buffer)
        except ValueError:  # unusual in some way
            return grey_picture(encoded)
        return np.asarray(picture[..., 0], np.uint8)

    def colour_picture(self, encoded: bytes, rows: int | None = None) -> ColourPicture:
        """Do `pictures.colour_picture` for the first rows; in memory that the next one reuses.

        Raises
        ------
        PictureError
            As `grey_picture`.
        """
        header = picture_header(encoded)
        if header is None or header.objection(len(encoded)):
            return colour_picture(encoded)  # decides about unusual pictures
        # The colours of the last row are interpolated with those below it.
        seen = header.height_px if rows is None else min(rows + ROWS_OF_BLOCKS, header.height_px)
        is_top = header.is_sequential and seen < header.height_px
        told = self._with_height(encoded, header.height_at, seen) if is_top else encoded
        size = 3 * (seen if is_top else header.height_px) * header.width_px
        if size > len(self._colours):
            self._colours = np.empty(size, np.uint8)
        try:
            picture = simplejpeg.decode_jpeg(told, "RGB", buffer=self._colours[:size], strict=not is_top)
        except ValueError:  # unusual in some way
            return colour_picture(encoded)
        return np.asarray(picture[:rows], np.uint8)

    def frame(
        self, encoded: Encoded, slot: int, focal_length_mm: float | None, rows: int | None, *, has_colour: bool = False
    ) -> FramePicture | TopOfFrame:
        """Return a frame, or only as many of its first rows as are needed, if that saves anything.

        With `has_colour` it can be seen in colour too.

        Raises
        ------
        PictureError
            As `grey_picture`.
        """

        def whole() -> FramePicture:
            pixels = self.grey_picture(encoded, slot)
            return FramePicture(pixels, focal_length_mm, self._coloured(encoded) if has_colour else None)

        if isinstance(encoded, GroupPicture):
            return whole()  # a video's picture is decoded wholly or not at all
        header = None if rows is None else picture_header(encoded)
        if rows is None or header is None or not header.is_sequential or rows >= header.height_px:
            return whole()
        if header.objection(len(encoded)):
            return whole()  # which reports it
        # a decoder stops after the number of rows in the header
        cut = self._with_height(encoded, header.height_at, rows)
        try:
            buffer = self._slot(slot, rows * header.width_px)
            top = simplejpeg.decode_jpeg(cut, "GRAY", buffer=buffer, strict=False)
        except ValueError:
            return whole()
        coloured = partial(self.colour_picture, encoded, rows) if has_colour else None
        return TopOfFrame(np.asarray(top[..., 0], np.uint8), header.height_px, focal_length_mm, whole, coloured)

    def _coloured(self, encoded: Encoded) -> Coloured:
        """Return a function that decodes the picture decompressed last in colour."""
        if isinstance(encoded, GroupPicture):
            return self._video.coloured(encoded)
        return partial(self.colour_picture, encoded)

    def _with_height(self, encoded: bytes, at: int, rows: int) -> memoryview:
        """Return a JPEG with another height in its header, in reused memory."""
        if len(self._jpeg) < len(encoded):
            self._jpeg = bytearray(len(encoded))
        cut = memoryview(self._jpeg)[: len(encoded)]
        cut[:] = encoded
        cut[at : at + 2] = rows.to_bytes(2)
        return cut

    def _slot(self, slot: int, size: int) -> GreyPicture:
        self.reserve(slot + 1)
        slots, room = self._memory.shape
        if size > room:
            if slots > 1 and slots * size > MAX_BATCH_PIXELS:
                return np.empty(size, np.uint8)
            self._memory = np.empty((slots, size), np.uint8)  # earlier pictures keep the old memory alive
        return self._memory[slot, :size]


def batch_frames(size_px: tuple[int, int]) -> int:
    """Return how many frames make a batch for a panel picture of this size (width, height)."""
    width, height = size_px
    return max(1, min(MAX_BATCH_FRAMES, MAX_BATCH_PIXELS // (width * height)))
