"""The way of a pivot to where its needles turn; each step looks at what the one before it did to what is left.

A needle that is learned around a wrong pivot takes in a part of what its tilts tell, so a step to where they point
falls short; where the needle hardly turns it may go too far instead, and the next one further. Two places tell by how
much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

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

    def on(self, left_px: Vector, others_px: Vector = (0.0, 0.0)) -> PivotPath:
        """A step on.

        The first goes where the tilts point, the next ones along the secant through the last two places (D. G.
        Anderson, J. ACM 12, 1965, with a depth of one). It may lead back, away from where the tilts point: not if that
        is away from the other gauges, too. Then nearer needles are found better, and tell more.

        Parameters
        ----------
        left_px
            Where the tilts point to from here.
        others_px
            How far the panel's gauges are to be moved as a rule.
        """
        step_px = left_px
        if self.step_px is not None:
            secant_px = _secant_px(left_px, self.step_px, self.left_px)
            to_others_px = np.subtract(others_px, self.moved_px)
            if np.dot(secant_px, left_px) > 0 or np.dot(to_others_px, left_px) <= 0:
                step_px = secant_px
        moved_px = (self.moved_px[0] + step_px[0], self.moved_px[1] + step_px[1])
        return PivotPath(moved_px, step_px, left_px, was_moved=True)


def _secant_px(left_px: Vector, last_step_px: Vector, last_left_px: Vector) -> Vector:
    left, changed = np.array(left_px), np.subtract(left_px, last_left_px)
    if not changed.any():
        return left_px
    step = left - (left @ changed) / (changed @ changed) * (changed + last_step_px)
    farthest_px = FARTHEST * math.hypot(*left_px) if step @ left > 0 else math.hypot(*last_step_px)
    x, y = (step * min(1.0, farthest_px / max(math.hypot(*step), 1e-12))).tolist()
    return x, y
