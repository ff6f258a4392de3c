"""Needle templates: what an unwrapped needle looks like, and which of its pixels to trust.

A template is cut once per gauge from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). Its
rows are angle around the needle's axis, an odd number of them, the axis in the middle row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import median_of
from decoder.imaging.thresholds import HALF
from decoder.matching.thresholds import OUTLINE_PART
from decoder.panel.arrays import Floats

T = TypeVar("T")

# The part of a needle's full contrast at which its blurred edge has faded out.
TOUCH_LEVEL = 0.1


@dataclass(frozen=True, eq=False)
class NeedleTemplate:
    """An unwrapped needle.

    All arrays are (H, C) float32, H odd: rows of angle, the axis in the middle one, by columns of radius.

    Attributes
    ----------
    pixels
        The needle on a plain dial, as which it is searched for.
    light, transparency
        The needle over any background: it shows as `light + transparency * background`. If the background is unknown,
        `light` is the whole picture.
    trust
        In [0, 1]: how well each pixel follows `light` and `transparency`.
    step_deg
        Degrees per row.
    """

    pixels: Floats
    light: Floats
    transparency: Floats
    trust: Floats
    step_deg: float
    _made: dict[Callable[..., object], object] = field(default_factory=dict, init=False, repr=False)

    def __getstate__(self) -> dict[str, object]:
        """Leave out what was computed from it, so that equal templates are equal bytes."""
        own = {each.name: getattr(self, each.name) for each in fields(self)}
        return own | {"_made": {}}

    def once(self, make: Callable[[NeedleTemplate], T]) -> T:
        """Return what a function makes of this template, computing it on first use."""
        if make not in self._made:
            self._made[make] = make(self)
        return cast("T", self._made[make])

    @property
    def rows(self) -> int:
        """H, an odd number."""
        return int(self.pixels.shape[0])

    def place(self, level: float) -> NDArray[np.bool_]:
        """(H, C): where the needle differs from its surroundings by more than this part of its full contrast."""
        difference, contrast = self._difference
        place: NDArray[np.bool_] = (difference > level * contrast) & (contrast > contrast.max() / 4)
        return place

    @cached_property
    def _difference(self) -> tuple[Floats, Floats]:
        """(H, C) and (C,): the difference of the needle from its surroundings, and its maximum around the axis."""
        edge = max(1, self.rows // 10)
        surroundings = median_of(np.concatenate([self.pixels[:edge], self.pixels[-edge:]]))
        difference = np.abs(self.pixels - surroundings)
        return difference, difference[self.rows // 4 : self.rows - self.rows // 4].max(axis=0)

    @cached_property
    def touched(self) -> NDArray[np.bool_]:
        """(H, C): where the needle shows at all: its blurred edge, too, and columns that it fills, next to its hub."""
        return self.place(TOUCH_LEVEL) | (self.transparency < HALF).all(axis=0)

    @cached_property
    def outline(self) -> NDArray[np.bool_]:
        """(H, C): where the needle itself is, without its surroundings."""
        return self.place(OUTLINE_PART)

    @cached_property
    def half_width_deg(self) -> float:
        """Half of the outline's largest extent in angle."""
        rows = np.flatnonzero(self.outline.any(axis=1))
        return float(np.abs(rows - (self.rows - 1) / 2).max()) * self.step_deg if rows.size else 0.0


def odd_rows(span_deg: float, step_deg: float) -> int:
    """Return the odd number of rows that covers a span."""
    return 2 * round(span_deg / step_deg / 2) + 1
