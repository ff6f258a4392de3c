"""How a pivot moves while a reader is fitted to a flight: the steps taken, and the uncertainty they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from decoder.learning.thresholds import DRAWN_PX, SEARCHED_PART, SETTLED_PX
from decoder.registration.pivot import UNKNOWN, Pivot

Vector = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PivotPath:
    """How far a pivot has been moved, (x, y) pixels in its dial's own plane.

    Attributes
    ----------
    far_px
        From where it was drawn to where a search found it.
    is_found
        Whether the search is finished.
    moved_px
        In total since then, by tilts.
    step_px
        In the last step; None if it stayed.
    """

    far_px: Vector = (0.0, 0.0)
    is_found: bool = False
    moved_px: Vector = (0.0, 0.0)
    step_px: Vector | None = None

    @property
    def beside_px(self) -> Vector:
        """How far the pivot is from where it is drawn."""
        return self.far_px[0] + self.moved_px[0], self.far_px[1] + self.moved_px[1]

    @property
    def is_far(self) -> bool:
        """Whether it was drawn so far off that it took a search to find it."""
        return self.far_px != (0.0, 0.0)

    def from_afar(self, step_px: Vector | None, reach_px: float) -> PivotPath:
        """Move to where a search found the pivot, if within reach; None as the step means nothing better was found."""
        if step_px is None:
            return replace(self, is_found=True, step_px=None)
        far_px = self.far_px[0] + step_px[0], self.far_px[1] + step_px[1]
        if math.hypot(*far_px) > reach_px:
            return replace(self, is_found=True, step_px=None)
        return replace(self, far_px=far_px, step_px=step_px)

    @property
    def was_moved(self) -> bool:
        """Whether the pivot is anywhere but where it is drawn."""
        return self.beside_px != (0.0, 0.0)

    def is_right(self, pivot: Pivot) -> bool:
        """Whether the pivot needs no further step: near enough to the drawing if never moved, else converged."""
        if self.was_moved:
            return math.hypot(*pivot.shrunk_px) <= SETTLED_PX
        return math.hypot(*pivot.offset_px) <= DRAWN_PX or not pivot.is_certain

    def with_search(self, pivot: Pivot, radius_px: float) -> Pivot:
        """Combine the estimate from needles' tilts with the position that a search found."""
        if not self.is_far:
            return pivot
        told = np.linalg.inv(pivot.covariance_px2)
        searched = np.eye(2) / (SEARCHED_PART * radius_px) ** 2
        covariance = np.linalg.inv(told + searched)
        x, y = (covariance @ (told @ np.array(pivot.offset_px) - searched @ np.array(self.moved_px))).tolist()
        return replace(pivot, offset_px=(x, y), covariance_px2=covariance)

    def within_reach(self, pivot: Pivot, reach_px: float) -> Pivot:
        """Discard an estimate further from the drawing than anybody would misplace a centre."""
        if math.dist(self.beside_px, [-off for off in pivot.offset_px]) <= reach_px:
            return pivot
        return replace(pivot, offset_px=UNKNOWN.offset_px, covariance_px2=UNKNOWN.covariance_px2)

    def next(self, pivot: Pivot) -> PivotPath:
        """Step to where the tilts put the pivot, as far as they are certain; a pivot that is right stays.

        A needle learned around a wrong pivot absorbs part of its tilts, so each step falls short and the next one
        continues from there.
        """
        if self.is_right(pivot):
            return replace(self, step_px=None)
        x, y = pivot.shrunk_px.tolist()
        return replace(self, moved_px=(self.moved_px[0] + x, self.moved_px[1] + y), step_px=(x, y))

    def back_to(self, earlier: PivotPath) -> PivotPath:
        """Step back to where the pivot was; no step if it still is there."""
        (x0, y0), (x1, y1) = self.beside_px, earlier.beside_px
        return replace(earlier, step_px=None if (x0, y0) == (x1, y1) else (x1 - x0, y1 - y0))

    def with_doubt(self, pivot: Pivot, first: Pivot) -> Pivot:
        """Add to a pivot's covariance what its steps leave uncertain; `first` is the estimate behind the first step."""
        if not self.was_moved:
            return pivot
        settled = pivot.settled(first.offset_px, self.moved_px)
        return settled if self.is_right(pivot) else settled.unsettled()
