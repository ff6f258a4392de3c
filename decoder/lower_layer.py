"""The lower of two needles as it shows beside the upper one, in many windows at once.

Where the edges of two needles run along each other, what they cover does not multiply: on the far side of the lower
needle's axis the upper's edge lies within the lower's body, so what shows of the lower is the difference of what both
cover; on the near side they lie side by side, and both show as long as there is room. What is drawn or reflected layer
by layer does multiply. A mixture is little wrong in either case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import cubic_weights

MIN_COVER = 0.05
# How much of the mixture is edges that lie along each other, rather than layers that multiply.
ALONG_PART = np.float32(0.7)


class LowerNeedle:
    """A needle as the lower one in windows of so many rows."""

    def __init__(self, template: NeedleTemplate, height: int) -> None:
        self._height, self._rows = height, template.rows
        layers = np.stack([template.light, template.transparency])
        padded = np.pad(layers, ((0, 0), (height + 3, height + 3), (0, 0)), "edge")
        _, rows, columns = padded.shape
        layer, row, column = padded.strides
        self._shape = (height, columns)
        self._least = np.full(self._shape, MIN_COVER, np.float32)  # NumPy is slower with a number
        shape = (2, rows - height - 2, (height + 3) * columns)
        self._blocks = np.ndarray(shape, padded.dtype, padded, strides=(layer, row, column))

    def at(self, rows: Floats) -> LowerLayer:
        """With its axis on a fractional row, (..., M), of each window."""
        from_axis = np.arange(self._height) - rows[..., None]
        own = from_axis + (self._rows - 1) / 2
        light, transparency = self._interpolated(own[..., 0].ravel()).reshape(2, *rows.shape, *self._shape)
        cover = np.subtract(np.float32(1.0), transparency, out=transparency)
        cover *= ((own >= 0) & (own <= self._rows - 1)).astype(np.float32)[..., None]
        light /= np.maximum(cover, self._least)
        far = from_axis * np.sign(rows - (self._height - 1) / 2)[..., None] >= 0
        return LowerLayer(cover, light, far.astype(np.float32)[..., None])

    def _interpolated(self, first: Floats) -> Floats:
        """(2, M, H * C): both layers from a fractional row on, (M,), by cubic interpolation; beyond the ends, those."""
        before = np.floor(first)
        weights = np.stack([cubic_weights(first - before)] * 2, axis=1).astype(np.float32)
        start = limited(before.astype(np.intp) + self._height + 2, 0, self._blocks.shape[1] - 1)
        blocks = self._blocks[np.array([[0], [1]]), start]
        layer, window, column = blocks.strides
        height, columns = self._shape
        shape, strides = (4, 2, len(first), height * columns), (columns * column, layer, window, column)
        taps = np.ndarray(shape, blocks.dtype, blocks, strides=strides)
        found: Floats = np.einsum("klm,klmx->lmx", weights, taps)
        return found


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
        (..., M, H, 1): 1 on the rows beyond its axis, seen from the upper needle's, else 0.
    """

    cover: Floats
    colour: Floats
    far: Floats

    def chosen(self, which: Indices | slice) -> LowerLayer:
        """Some of the windows."""
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
        layered = np.multiply(np.float32(1.0) - ALONG_PART, self.cover, out=nested)
        layered *= transparency
        shown += layered
        return shown

    def through(self, transparency: Floats, face: Floats) -> Floats:
        """(..., M, H, C): what is seen of it and the face, through an upper needle of so much transparency; (M, H, C).

        Through next to no transparency the face alone is seen.
        """
        shown = self.shown(transparency)
        shown *= (transparency > MIN_COVER).astype(np.float32)
        seen: Floats = self.colour - face
        seen *= shown
        seen += transparency * face
        return seen

    def behind(self, transparency: Floats) -> tuple[Floats, Floats]:
        """What lies behind the upper needle, as `light + part * face`: (..., M, H, C) each."""
        shown = self.shown(transparency)
        hardly = transparency <= MIN_COVER
        held = np.maximum(transparency, np.float32(MIN_COVER))
        part = transparency - shown
        np.maximum(part, np.float32(0.0), out=part)
        part /= held
        np.copyto(part, np.float32(1.0), where=hardly)
        shown *= self.colour
        shown /= held
        np.copyto(shown, np.float32(0.0), where=hardly)
        return shown, part
