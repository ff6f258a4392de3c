"""The lower of two needles as it shows through the upper one, in many windows at once: as `needle_layer` has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.arrays import Floats, Indices, Mask
from decoder.needle_layer import MIN_COVER
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import rows_at


@dataclass(frozen=True, slots=True)
class LowerLayer:
    """A needle in M windows of another one that lies over it.

    Attributes
    ----------
    cover
        (M, H, C): how much of each pixel it covers.
    colour
        (M, H, C): the light that it adds where it covers all of a pixel.
    far
        (M, H, 1): the rows beyond its axis, seen from the upper needle's.
    """

    cover: Floats
    colour: Floats
    far: Mask

    @classmethod
    def at(cls, lower: NeedleTemplate, height: int, rows: Floats) -> Self:
        """With its axis on a fractional row, (M,), of each window of so many rows."""
        own = np.arange(height) - rows[:, None] + (lower.rows - 1) / 2
        inside = ((own >= 0) & (own <= lower.rows - 1))[..., None]
        layers = rows_at(np.concatenate([lower.light, lower.transparency], axis=1), own.ravel())
        light, transparency = np.split(layers.reshape(*own.shape, -1), 2, axis=2)
        cover = ((1.0 - transparency) * inside).astype(np.float32)
        side = np.sign(rows - (height - 1) / 2)[:, None]
        far = ((np.arange(height) - rows[:, None]) * side >= 0)[..., None]
        return cls(cover, light / np.maximum(cover, np.float32(MIN_COVER)), far)

    def chosen(self, which: Indices | slice) -> LowerLayer:
        """Some of the windows."""
        return LowerLayer(self.cover[which], self.colour[which], self.far[which])

    def shown(self, transparency: Floats) -> Floats:
        """(M, H, C): how much of each pixel shows beside an upper needle of this transparency, (M, H, C) or (H, C)."""
        beside = np.minimum(self.cover, transparency)
        nested = np.maximum(self.cover - (np.float32(1.0) - transparency), np.float32(0.0))
        shown: Floats = np.where(self.far, nested, beside)
        return shown

    def behind(self, transparency: Floats) -> tuple[Floats, Floats]:
        """What lies behind the upper needle, as `light + part * face`: (M, H, C) each."""
        shown = self.shown(transparency)
        through = transparency > MIN_COVER
        held = np.maximum(transparency, np.float32(MIN_COVER))
        part = np.where(through, np.maximum(transparency - shown, np.float32(0.0)) / held, np.float32(1.0))
        return np.where(through, self.colour * shown / held, np.float32(0.0)), part
