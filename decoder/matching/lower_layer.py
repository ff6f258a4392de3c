"""The lower of two needles as it shows beside the upper one, in many windows at once.

Where the edges of two needles run along each other, what they cover does not multiply: on the far side of the lower
needle's axis the upper's edge lies within the lower's body, so what shows of the lower is the difference of what both
cover; on the near side they lie side by side, and both show as long as there is room. What is drawn or reflected layer
by layer does multiply. A mixture is little wrong in either case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import blocks_of, cubic_weights
from decoder.matching.thresholds import MIN_CONTRAST_PART
from decoder.panel.arrays import Floats, Indices, limited

# How much of the mixture is edges that lie along each other, rather than layers that multiply.
ALONG_PART = np.float32(0.7)


class LowerNeedle:
    """A needle as the lower one in windows of so many rows."""

    def __init__(self, template: NeedleTemplate, height: int) -> None:
        self._height, self._rows = height, template.rows
        columns = template.light.shape[1]
        self._shape = (height, columns)
        self._least = np.full(self._shape, MIN_CONTRAST_PART, np.float32)  # NumPy is slower with a number
        layers = np.stack([template.light, np.float32(1.0) - template.transparency])
        padded = np.pad(layers, ((0, 0), (height + 3, height + 3), (0, 0)), "edge")
        self._both, self._blocks = np.arange(2)[:, None], blocks_of(padded, height + 3)
        # Rows of the needle and of none, for one that lies on whole rows and for one between them; likewise for its
        # axis. They are as wide as the windows: NumPy is slower with a column.
        whole, between = self._rows, self._rows - 1
        self._inside = blocks_of(_stripes(columns, height, whole, height, between, height + 1), height)
        self._far = blocks_of(_stripes(columns, height, height, height), height)

    def at(self, rows: Floats) -> LowerLayer:
        """With its axis on a fractional row, (..., M), of each window."""
        first = (self._rows - 1) / 2 - rows.ravel()
        before = np.floor(first)
        part, start = first - before, before.astype(np.intp) + self._height
        light, cover = self._interpolated(part, start)
        cover *= self._inside[limited(start, 0, self._height + self._rows) + (part > 0) * (self._height + self._rows)]
        shape = (*rows.shape, *self._shape)
        light, cover = light.reshape(shape), cover.reshape(shape)
        light /= np.maximum(cover, self._least)
        return LowerLayer(cover, light, self._far[self._far_start(rows)].reshape(shape))

    def _interpolated(self, part: Floats, start: Indices) -> Floats:
        """(2, M, H * C): both layers, a part of a row, (M,), behind a row on; by cubic interpolation."""
        weights = np.array(cubic_weights(part), np.float32)
        blocks = self._blocks[self._both, limited(start + 2, 0, self._blocks.shape[1] - 1)]
        layer, window, column = blocks.strides
        height, columns = self._shape
        shape, strides = (4, 2, len(part), height * columns), (columns * column, layer, window, column)
        taps = np.ndarray(shape, blocks.dtype, blocks, strides=strides)
        found: Floats = np.einsum("km,klmx->lmx", weights, taps)
        return found

    def _far_start(self, rows: Floats) -> Indices:
        """(..., M): where in the stripes the windows begin whose rows beyond the needle's axis are to be 1."""
        middle = (self._height - 1) / 2
        start = np.where(rows > middle, self._height - np.ceil(rows), 2 * self._height - 1 - np.floor(rows))
        start[rows == middle] = self._height
        found: Indices = limited(start.astype(np.intp), 0, 2 * self._height)
        return found


def _stripes(columns: int, *heights: int) -> Floats:
    """(S, C) float32: rows of 0 and rows of 1 by turns, so many each."""
    values = np.repeat(np.arange(len(heights)) % 2, heights)
    return np.repeat(values[:, None], columns, axis=1).astype(np.float32)


@dataclass(frozen=True, slots=True)
class LowerLayer:
    """A needle in windows of another one that lies over it, M of them or in any order, (..., M).

    Attributes
    ----------
    cover
        (..., M, H, C): how much of each pixel it covers.
    colour
        (..., M, H, C): the light that it adds where it covers all of a pixel.
    far
        (..., M, H, C): 1 on the rows beyond its axis, seen from the upper needle's, else 0.
    """

    cover: Floats
    colour: Floats
    far: Floats

    def chosen(self, which: Indices | slice) -> LowerLayer:
        """Return some of the windows."""
        return LowerLayer(self.cover[which], self.colour[which], self.far[which])

    def shown(self, transparency: Floats) -> Floats:
        """(..., M, H, C): how much of each pixel shows beside an upper needle of so much transparency, (M, H, C)."""
        opacity = np.float32(1.0) - transparency
        shown: Floats = np.minimum(self.cover, transparency)
        nested = np.maximum(self.cover, opacity)
        nested -= opacity
        nested -= shown
        nested *= self.far
        shown += nested
        shown *= ALONG_PART
        layered = np.multiply((np.float32(1.0) - ALONG_PART) * transparency, self.cover, out=nested)
        shown += layered
        return shown

    def through(self, transparency: Floats, face: Floats) -> Floats:
        """(..., M, H, C): what is seen of it and the face, through an upper needle of so much transparency; (M, H, C).

        Through next to no transparency the face alone is seen.
        """
        shown = self.shown(transparency)
        shown *= (transparency > MIN_CONTRAST_PART).astype(np.float32)
        seen: Floats = self.colour - face
        seen *= shown
        seen += transparency * face
        return seen

    def behind(self, transparency: Floats) -> tuple[Floats, Floats]:
        """Return what lies behind the upper needle, as `light + part * face`: (..., M, H, C) each."""
        shown = self.shown(transparency)
        hardly = transparency <= MIN_CONTRAST_PART
        held = np.maximum(transparency, np.float32(MIN_CONTRAST_PART))
        part = transparency - shown
        np.maximum(part, np.float32(0.0), out=part)
        part /= held
        np.copyto(part, np.float32(1.0), where=hardly)
        shown *= self.colour
        shown /= held
        np.copyto(shown, np.float32(0.0), where=hardly)
        return shown, part
