"""How far a pivot was moved while a reader was fitted to a flight, by which steps, and what they leave in doubt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from decoder.learning.thresholds import DRAWN_PX, SEARCHED_PART, SETTLED_PX
from decoder.registration.pivot import UNKNOWN, Pivot

Vector = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PivotPath:
    """How far a pivot has been moved, (x, y) pixels of its dial's own plane.

    Attributes
    ----------
    far_px
        As far as it was drawn beside where a search found it.
    is_found
        Whether a search need not go on.
    moved_px
        From there, in all.
    step_px
        At last; None if it stayed.
    """

    far_px: Vector = (0.0, 0.0)
    is_found: bool = False
    moved_px: Vector = (0.0, 0.0)
    step_px: Vector | None = None

    @property
    def beside_px(self) -> Vector:
        """How far it was moved from where it is drawn."""
        return self.far_px[0] + self.moved_px[0], self.far_px[1] + self.moved_px[1]

    @property
    def is_far(self) -> bool:
        """Whether it was drawn so far off that only a search found it."""
        return self.far_px != (0.0, 0.0)

    def from_afar(self, step_px: Vector | None, reach_px: float) -> PivotPath:
        """Go on to where a search found it, if that is within reach; None if it found nothing better."""
        if step_px is None:
            return replace(self, is_found=True, step_px=None)
        far_px = self.far_px[0] + step_px[0], self.far_px[1] + step_px[1]
        if math.hypot(*far_px) > reach_px:
            return replace(self, is_found=True, step_px=None)
        return replace(self, far_px=far_px, step_px=step_px)

    @property
    def was_moved(self) -> bool:
        """Whether it ever was."""
        return self.beside_px != (0.0, 0.0)

    def is_right(self, pivot: Pivot) -> bool:
        """Whether needles turn where it is: to what is drawn if it was never moved, else to what a step settles to."""
        if self.was_moved:
            return math.hypot(*pivot.shrunk_px) <= SETTLED_PX
        return math.hypot(*pivot.offset_px) <= DRAWN_PX or not pivot.is_certain

    def with_search(self, pivot: Pivot, radius_px: float) -> Pivot:
        """Let what a search found count beside what needles' tilts tell."""
        if not self.is_far:
            return pivot
        told = np.linalg.inv(pivot.covariance_px2)
        searched = np.eye(2) / (SEARCHED_PART * radius_px) ** 2
        covariance = np.linalg.inv(told + searched)
        x, y = (covariance @ (told @ np.array(pivot.offset_px) - searched @ np.array(self.moved_px))).tolist()
        return replace(pivot, offset_px=(x, y), covariance_px2=covariance)

    def within_reach(self, pivot: Pivot, reach_px: float) -> Pivot:
        """Believe no needle that seems to turn further off than any hand draws: then it tells nothing."""
        if math.dist(self.beside_px, [-off for off in pivot.offset_px]) <= reach_px:
            return pivot
        return replace(pivot, offset_px=UNKNOWN.offset_px, covariance_px2=UNKNOWN.covariance_px2)

    def next(self, pivot: Pivot) -> PivotPath:
        """Step on to where the needles turn, as far as their tilts tell it; a pivot that is right stays.

        A needle that is learned around a wrong pivot takes in a part of what its tilts tell, so a step to where they
        point falls short, and the next one goes on from there.
        """
        if self.is_right(pivot):
            return replace(self, step_px=None)
        x, y = pivot.shrunk_px.tolist()
        return replace(self, moved_px=(self.moved_px[0] + x, self.moved_px[1] + y), step_px=(x, y))

    def with_doubt(self, pivot: Pivot, first: Pivot) -> Pivot:
        """Add to a pivot's covariance what its steps, of which `first` told the first, leave in doubt."""
        if not self.was_moved:
            return pivot
        settled = pivot.settled(first.offset_px, self.moved_px)
        return settled if self.is_right(pivot) else settled.unsettled()
