"""Strips: rows of unwrapped gauges, cut around a needle in many frames, and what a needle leaves uncovered of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from decoder.panel.arrays import Floats, Indices, Mask, limited


@dataclass(frozen=True, slots=True)
class Strips:
    """The part of one gauge around a needle in M frames.

    Attributes
    ----------
    pixels
        (N, S, C) float32: of these frames and possibly others.
    frames
        (M,): the indices of these frames in `pixels`.
    first
        (M,): the gauge's row of the first row of `pixels`.
    face
        (R, C) float32: the dial without needles.
    """

    pixels: Floats
    frames: Indices
    first: Indices
    face: Floats

    @classmethod
    def of(cls, pixels: Floats, first: Indices, face: Floats) -> Self:
        """Return the strips of all frames that `pixels` contains."""
        return cls(pixels, np.arange(len(pixels)), first, face)

    def part(self, which: Indices | Mask) -> Strips:
        """Return some of the frames."""
        return Strips(self.pixels, self.frames[which], self.first[which], self.face)

    def rows(self, index: Indices, step: int = 1) -> tuple[Floats, Floats]:
        """Return gauge and face on rows (M, H) of the gauge, every `step`-th column of them: (M, H, C') each."""
        pixels = self.pixels[:, :, ::step]
        own = limited(index - self.first[:, None], 0, pixels.shape[1] - 1)
        seen = pixels[self.frames[:, None], own]
        return seen, self.face[limited(index, 0, len(self.face) - 1), ::step]

    def windows(self, rows: Indices, axis: int) -> tuple[Floats, Floats]:
        """Return gauge and face around a row of each frame (M,), or as near to it as they reach: (M, H * C) each."""
        height, top_rows = 2 * axis + 1, rows - axis
        pixels, face = blocks_of(self.pixels, height), blocks_of(self.face, height)
        seen = pixels[self.frames, limited(top_rows - self.first, 0, pixels.shape[1] - 1)]
        return seen, face[limited(top_rows, 0, len(face) - 1)]


def blocks_of(pixels: Floats, height: int) -> Floats:
    """(..., S - H + 1, H * C): a view on contiguous pixels (..., S, C) with all blocks of H rows."""
    *others, rows, columns = pixels.shape
    shape, strides = (*others, rows - height + 1, height * columns), pixels.strides
    return np.ndarray(shape, pixels.dtype, pixels, strides=strides)


def rows_at(strip: Floats, rows: Floats) -> Floats:
    """Interpolate an unwrapped gauge at consecutive rows, maybe fractional: (len(rows), C); see `rows_of_each`."""
    (there,) = rows_of_each([strip], rows[None])
    return np.asarray(there)


def rows_of_each(strips: Sequence[Floats], rows: Floats) -> Floats:
    """Interpolate K unwrapped gauges by cubics, each at consecutive rows of its own, (K, H): (K, H, C).

    The end rows of a gauge repeat beyond them.
    """
    first = np.floor(rows[:, 0]).astype(np.intp)
    index = first[:, None] + np.arange(-1, rows.shape[1] + 2)
    parts = [strip.take(own, axis=0, mode="clip") for strip, own in zip(strips, index, strict=True)]
    return rows_between(np.stack(parts, dtype=np.float32), rows[:, 0] - first)


def rows_between(strips: Floats, parts: Floats) -> Floats:
    """Interpolate K strips (K, H + 3, C) float32 by cubics, each a part (K,) behind its second row: (K, H, C)."""
    count, rows, columns = strips.shape
    weights = np.array([cubic_weights(part) for part in parts.tolist()], np.float32)
    taps = np.ndarray((count, 4, (rows - 3) * columns), strips.dtype, strips, strides=strips.strides)
    between: Floats = np.einsum("kt,ktx->kx", weights, taps)
    return between.reshape(count, rows - 3, columns)


def cubic_weights(part: Any) -> tuple[Any, Any, Any, Any]:  # noqa: ANN401 - a number or an array
    """Return the weights of the row before a place, its own, and the next two, at a fraction of a row (Catmull-Rom)."""
    square = part * part
    return (
        -0.5 * part + square - 0.5 * square * part,
        1.0 - 2.5 * square + 1.5 * square * part,
        0.5 * part + 2.0 * square - 1.5 * square * part,
        0.5 * square * (part - 1.0),
    )


class UncoveredPixels:
    """The pixels that a needle leaves uncovered, in blocks of every `step`-th row and column.

    Parameters
    ----------
    touched
        (H, C): the pixels that the needle touches.
    rows, step
        How many rows a block has, and the distance of its rows and columns.
    """

    def __init__(self, touched: Mask, rows: int, step: int = 1) -> None:
        reach = (rows - 1) * step + 1
        self._margin = reach + 1
        whole = np.pad(touched[:, ::step], ((self._margin, self._margin), (0, 0)))
        between = whole.copy()
        between[1:] |= whole[:-1]
        left = np.logical_not([whole, between]).astype(np.float32)
        (_, length, columns), (layer, row, column) = left.shape, left.strides
        shape, strides = (2, length - reach + 1, rows, columns), (layer, row, step * row, column)
        self._blocks = np.ndarray(shape, left.dtype, left, strides=strides)

    def at(self, first_rows: Indices, needle_rows: Floats) -> Floats:
        """(M, rows, C') float32: 1 where a pixel is uncovered, in blocks starting at rows (M,).

        The needle's own first rows (M,) may lie between two others; it then touches the pixels of both.
        """
        before = np.floor(needle_rows)
        start = first_rows - before.astype(np.intp) + self._margin
        left: Floats = self._blocks[
            (needle_rows > before).astype(np.intp), limited(start, 0, self._blocks.shape[1] - 1)
        ]
        return left
