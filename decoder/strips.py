"""Strips: the parts of one unwrapped gauge around a needle in many frames, and the windows that are cut from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited


@dataclass(frozen=True, slots=True)
class Strips:
    """The part of one gauge around a needle in M frames.

    Attributes
    ----------
    pixels
        (N, S, C) float32: of these frames and maybe others.
    frames
        (M,): which of them they are.
    first
        (M,): the gauge's row that is the first of them.
    face
        (R, C) float32: the dial without needles.
    """

    pixels: Floats
    frames: Indices
    first: Indices
    face: Floats

    @classmethod
    def of(cls, pixels: Floats, first: Indices, face: Floats) -> Self:
        """Of all frames whose pixels these are."""
        return cls(pixels, np.arange(len(pixels)), first, face)

    def part(self, which: Indices | Mask) -> Strips:
        """Some of the frames."""
        return Strips(self.pixels, self.frames[which], self.first[which], self.face)

    def rows(self, index: Indices, step: int = 1) -> tuple[Floats, Floats]:
        """Gauge and face on rows (M, H) of the gauge, every so many columns of them: (M, H, C') each."""
        pixels = self.pixels[:, :, ::step]
        own = limited(index - self.first[:, None], 0, pixels.shape[1] - 1)
        seen = pixels[self.frames[:, None], own]
        return seen, self.face[limited(index, 0, len(self.face) - 1), ::step]

    def windows(self, rows: Indices, axis: int) -> tuple[Floats, Floats]:
        """Gauge and face around a row of each frame, (M,), as near to it as they reach: (M, H * C) each."""
        height, top_rows = 2 * axis + 1, rows - axis
        pixels, face = blocks_of(self.pixels, height), blocks_of(self.face, height)
        seen = pixels[self.frames, limited(top_rows - self.first, 0, pixels.shape[1] - 1)]
        return seen, face[limited(top_rows, 0, len(face) - 1)]


def blocks_of(pixels: Floats, height: int) -> Floats:
    """(..., S - H + 1, H * C): a view on contiguous pixels, (..., S, C), that shows all blocks of so many rows."""
    *others, rows, columns = pixels.shape
    shape, strides = (*others, rows - height + 1, height * columns), pixels.strides
    return np.ndarray(shape, pixels.dtype, pixels, strides=strides)
