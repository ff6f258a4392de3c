"""Needle templates: what an unwrapped needle looks like, and which of its pixels to trust.

A template is cut once per gauge from the panel picture, or given as a cropped unwrapped picture (thesis 3.2.1). Its
rows are angle around the needle's axis, an odd number of them, the axis in the middle row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import MAD_TO_SIGMA, median, median_of
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
    def beside_deg(self) -> float:
        """By how many degrees the needle's middle line lies beside its axis; shrunk towards 0 where that is unclear.

        The middle line is halfway between both edges. If columns disagree about it, the needle's outline is not
        symmetrical, and the offset is reduced by their scatter. It counts as half of the needle's width at most: what
        lies further beside may not be what was meant.
        """
        difference, contrast = self._difference
        clear = contrast >= HALF * contrast.max()
        clear &= np.maximum(difference[0], difference[-1]) < HALF * contrast
        level = HALF * contrast
        first, last = (_first_crossing(each, level) for each in (difference, difference[::-1]))
        width, middle = (self.rows - 1 - last - first)[clear], ((first + self.rows - 1 - last) / 2)[clear]
        if not middle.size:
            return 0.0
        line = float(median(middle))
        beside, spread = line - (self.rows - 1) / 2, MAD_TO_SIGMA * float(median(np.abs(middle - line)))
        beside = math.copysign(min(abs(beside), HALF * float(median(width))), beside)
        return math.copysign(math.sqrt(max(beside**2 - spread**2, 0.0)), beside) * self.step_deg

    @cached_property
    def half_width_deg(self) -> float:
        """Half of the outline's largest extent in angle."""
        rows = np.flatnonzero(self.outline.any(axis=1))
        return float(np.abs(rows - (self.rows - 1) / 2).max()) * self.step_deg if rows.size else 0.0


def _first_crossing(profiles: Floats, level: Floats) -> Floats:
    """Return the fractional row at which profiles (H, C) first rise above their level (C,)."""
    row = np.argmax(profiles > level, axis=0)
    columns = np.arange(profiles.shape[1])
    before, after = profiles[np.maximum(row - 1, 0), columns], profiles[row, columns]
    crossing: Floats = row - (after - level) / np.maximum(after - before, np.finfo(np.float32).eps)
    return crossing


def odd_rows(span_deg: float, step_deg: float) -> int:
    """Return the odd number of rows that covers a span."""
    return 2 * round(span_deg / step_deg / 2) + 1
