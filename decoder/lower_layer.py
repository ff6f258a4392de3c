"""The lower of two needles as it shows beside the upper one, in many windows at once.

Where the edges of two needles run along each other, what they cover does not multiply: on the far side of the lower
needle's axis the upper's edge lies within the lower's body, so what shows of the lower is the difference of what both
cover; on the near side they lie side by side, and both show as long as there is room. What is drawn or reflected layer
by layer does multiply. A mixture is little wrong in either case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.arrays import Floats, Indices, Mask
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import windows_at

MIN_COVER = 0.05
# How much of the mixture is edges that lie along each other, rather than layers that multiply.
ALONG_PART = np.float32(0.7)


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
        (..., M, H, 1): the rows beyond its axis, seen from the upper needle's.
    """

    cover: Floats
    colour: Floats
    far: Mask

    @classmethod
    def at(cls, lower: NeedleTemplate, height: int, rows: Floats) -> Self:
        """With its axis on a fractional row, (..., M), of each window of so many rows."""
        own = np.arange(height) - rows[..., None] + (lower.rows - 1) / 2
        inside = (own >= 0) & (own <= lower.rows - 1)
        light, transparency = np.split(windows_at(lower.both_layers, own), 2, axis=-1)
        cover = np.float32(1.0) - transparency
        if not inside.all():
            cover[~inside] = 0.0
        side = np.sign(rows - (height - 1) / 2)[..., None]
        far = ((np.arange(height) - rows[..., None]) * side >= 0)[..., None]
        return cls(cover, light / np.maximum(cover, np.float32(MIN_COVER)), far)

    def chosen(self, which: Indices | slice) -> LowerLayer:
        """Some of the windows."""
        return LowerLayer(self.cover[which], self.colour[which], self.far[which])

    def shown(self, transparency: Floats) -> Floats:
        """(..., M, H, C): how much of each pixel shows beside an upper needle of so much transparency, (M, H, C)."""
        nested = self.cover - (np.float32(1.0) - transparency)
        np.maximum(nested, np.float32(0.0), out=nested)
        shown: Floats = np.where(self.far, nested, np.minimum(self.cover, transparency))
        shown *= ALONG_PART
        layered = np.multiply(np.float32(1.0) - ALONG_PART, self.cover, out=nested)
        layered *= transparency
        shown += layered
        return shown

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
