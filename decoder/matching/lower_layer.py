"""The visible part of the lower of two needles, in many windows at once.

Where the edges of two needles run parallel, their coverage does not multiply. On the far side of the lower needle's
axis the upper needle's edge lies within the lower's body, so the lower shows by the difference of the two coverages; on
the near side they lie side by side, and both show as far as there is room. What is drawn or reflected layer by layer
does multiply. A mixture of the two is nearly right in either case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import blocks_of, cubic_weights
from decoder.matching.thresholds import MIN_CONTRAST_PART
from decoder.panel.arrays import Floats, Indices, limited

# The share of parallel edges in the mixture; the rest is layers that multiply.
ALONG_PART = np.float32(0.7)


class LowerNeedle:
    """A needle as the lower one, in windows of `height` rows."""

    def __init__(self, template: NeedleTemplate, height: int) -> None:
        self._height, self._rows = height, template.rows
        columns = template.light.shape[1]
        self._shape = (height, columns)
        self._least = np.full(self._shape, MIN_CONTRAST_PART, np.float32)  # NumPy is slower with a scalar
        layers = np.stack([template.light, np.float32(1.0) - template.transparency])
        padded = np.pad(layers, ((0, 0), (height + 3, height + 3), (0, 0)), "edge")
        self._both, self._blocks = np.arange(2)[:, None], blocks_of(padded, height + 3)
        # Masks of the needle's rows, for a needle on whole rows and for one between rows; likewise for the rows beyond
        # its axis. They are as wide as the windows, as NumPy is slower with a column.
        whole, between = self._rows, self._rows - 1
        self._inside = blocks_of(_stripes(columns, height, whole, height, between, height + 1), height)
        self._far = blocks_of(_stripes(columns, height, height, height), height)

    def at(self, rows: Floats) -> LowerLayer:
        """Place its axis on a fractional row of each window, (..., M)."""
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
        """(2, M, H * C): both layers from row `start` plus `part` (M,) of a row on, by cubic interpolation."""
        weights = np.array(cubic_weights(part), np.float32)
        blocks = self._blocks[self._both, limited(start + 2, 0, self._blocks.shape[1] - 1)]
        layer, window, column = blocks.strides
        height, columns = self._shape
        shape, strides = (4, 2, len(part), height * columns), (columns * column, layer, window, column)
        taps = np.ndarray(shape, blocks.dtype, blocks, strides=strides)
        found: Floats = np.einsum("km,klmx->lmx", weights, taps)
        return found

    def _far_start(self, rows: Floats) -> Indices:
        """(..., M): the start in the stripes of each window's mask of the rows beyond the needle's axis."""
        middle = (self._height - 1) / 2
        start = np.where(rows > middle, self._height - np.ceil(rows), 2 * self._height - 1 - np.floor(rows))
        start[rows == middle] = self._height
        found: Indices = limited(start.astype(np.intp), 0, 2 * self._height)
        return found


def _stripes(columns: int, *heights: int) -> Floats:
    """(S, C) float32: alternating blocks of rows of 0 and rows of 1, of these heights."""
    values = np.repeat(np.arange(len(heights)) % 2, heights)
    return np.repeat(values[:, None], columns, axis=1).astype(np.float32)


@dataclass(frozen=True, slots=True)
class LowerLayer:
    """A needle in M windows of another one that lies over it, (..., M).

    Attributes
    ----------
    cover
        (..., M, H, C): how much of each pixel it covers.
    colour
        (..., M, H, C): its light where it covers all of a pixel.
    far
        (..., M, H, C): 1 on the rows beyond its axis as seen from the upper needle's, else 0.
    """

    cover: Floats
    colour: Floats
    far: Floats

    def chosen(self, which: Indices | slice) -> LowerLayer:
        """Return some of the windows."""
        return LowerLayer(self.cover[which], self.colour[which], self.far[which])

    def shown(self, transparency: Floats) -> Floats:
        """(..., M, H, C): how much of each pixel shows beside an upper needle with this transparency (M, H, C)."""
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
        """(..., M, H, C): the light of the lower needle and the face, seen through the upper needle's transparency.

        Where the upper needle is all but opaque, only the face counts.
        """
        shown = self.shown(transparency)
        shown *= (transparency > MIN_CONTRAST_PART).astype(np.float32)
        seen: Floats = self.colour - face
        seen *= shown
        seen += transparency * face
        return seen

    def behind(self, transparency: Floats) -> tuple[Floats, Floats]:
        """Return what lies behind the upper needle as `light + part * face`, (..., M, H, C) each."""
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
