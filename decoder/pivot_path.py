"""The way of a pivot to where its needles turn; each step looks at what the one before it did to what is left.

A needle that is learned around a wrong pivot takes in a part of what its tilts tell, so a step to where they point
falls short; where the needle hardly turns it may go too far instead, and the next one further. Two places tell by how
much, as far as they tell more than their doubt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.pivots import Pivot

Vector = tuple[float, float]
# No step goes further than so many times what is left, and none further back than the last one came: two places that
# left nearly the same tell nothing of a third.
FARTHEST = 3.0


@dataclass(frozen=True, slots=True)
class PivotPath:
    """How far a pivot has been moved, (x, y) pixels of its dial's own plane.

    Attributes
    ----------
    moved_px
        In all.
    step_px
        At last; None if it stayed.
    left_px
        What was left before that step.
    was_moved
        Ever.
    """

    moved_px: Vector = (0.0, 0.0)
    step_px: Vector | None = None
    left_px: Vector = (0.0, 0.0)
    was_moved: bool = False

    def stay(self) -> PivotPath:
        """No step further."""
        return PivotPath(self.moved_px, None, self.left_px, self.was_moved)

    def to(self, there_px: Vector) -> PivotPath:
        """A step to where the other gauges are: its own needles were lost on the way and tell nothing."""
        step_px = (there_px[0] - self.moved_px[0], there_px[1] - self.moved_px[1])
        return PivotPath(there_px, step_px, step_px, was_moved=True)

    def on(self, pivot: Pivot, others_px: Vector = (0.0, 0.0)) -> PivotPath:
        """A step on, as far as the tilts tell it.

        The first goes where the tilts point, the next ones along the secant through the last two places (D. G.
        Anderson, J. ACM 12, 1965, with a depth of one). It may lead back, away from where the tilts point: not if that
        is away from the other gauges, too. Then nearer needles are found better, and tell more.

        Where the tilts hardly tell, no step is taken: what they seem to tell there changes from place to place by as
        much as they doubt it, and to follow that makes last bits into tenths of a pixel.

        Parameters
        ----------
        pivot
            Where the tilts point to from here, and how surely.
        others_px
            How far the panel's gauges are to be moved as a rule.
        """
        left = np.array(pivot.offset_px)
        step = left
        if self.step_px is not None:
            secant = _secant(pivot, self.step_px, self.left_px)
            to_others_px = np.subtract(others_px, self.moved_px)
            if np.dot(secant, left) > 0 or np.dot(to_others_px, left) <= 0:
                step = secant
        x, y = (pivot.told_part @ step).tolist()
        return PivotPath((self.moved_px[0] + x, self.moved_px[1] + y), (x, y), pivot.offset_px, was_moved=True)


def _secant(pivot: Pivot, last_step_px: Vector, last_left_px: Vector) -> Floats:
    """(2,): the step along the secant; what changed since the last place counts beside what is in doubt (a ridge)."""
    left, changed = np.array(pivot.offset_px), np.subtract(pivot.offset_px, last_left_px)
    in_spreads = np.linalg.solve(pivot.covariance_px2, changed)
    step: Floats = left - (left @ in_spreads) / (changed @ in_spreads + 1.0) * (changed + last_step_px)
    farthest_px = FARTHEST * math.hypot(*left) if step @ left > 0 else math.hypot(*last_step_px)
    return step * min(1.0, farthest_px / max(math.hypot(*step), 1e-12))
