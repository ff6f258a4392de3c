"""What a round of the fit says of pivots and lifts: which are moved on, which are right, and how surely they end.

A round reads the sample around the pivots as they are, and so tells how far they still are from where needles turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decoder.arrays import Floats
from decoder.pivot_path import PivotPath
from decoder.pivots import Pivot
from decoder.sorting import median_of
from decoder.uncertainty import DRAWN_PX

# A pivot that had to be moved is moved again until it is right to this: the first step falls a little short.
SETTLED_PX = 0.03
SETTLED_LIFT = 0.01


def further(paths: Sequence[PivotPath], pivots: Sequence[Pivot]) -> list[PivotPath]:
    """Each a step on to where its needles turn; one that is right to what can be drawn, or settled, stays."""
    totals_px = np.array([np.add(path.moved_px, pivot.offset_px) for path, pivot in zip(paths, pivots, strict=True)])
    return [
        _stepped(path, pivot, _middle(np.delete(totals_px, index, axis=0)))
        for index, (path, pivot) in enumerate(zip(paths, pivots, strict=True))
    ]


def _middle(places_px: Floats) -> tuple[float, float]:
    """The median of places (N, 2); where they are drawn, if there are none."""
    x, y = median_of(places_px).tolist() if len(places_px) else (0.0, 0.0)
    return x, y


def _stepped(path: PivotPath, pivot: Pivot, others_px: tuple[float, float]) -> PivotPath:
    if not is_off(pivot, was_moved=path.was_moved):
        return path.stay()
    return path.on(pivot, others_px) if pivot.tilts else path.to(others_px)


def ended(pivot: Pivot, first_px: tuple[float, float], path: PivotPath) -> Pivot:
    """A moved pivot as uncertain as its path leaves it."""
    settled = pivot.settled(first_px, path.moved_px)
    return settled.unsettled() if is_off(pivot, was_moved=True) else settled


def is_off(pivot: Pivot, *, was_moved: bool) -> bool:
    """Whether needles turn elsewhere: surely, and further off than is drawn; after a step, than it settles to."""
    if was_moved:  # needles that were lost on the way tell nothing, and are off all the same
        return math.hypot(*(pivot.told_px if pivot.tilts else pivot.offset_px)) > SETTLED_PX
    return math.hypot(*pivot.offset_px) > DRAWN_PX and pivot.is_certain


def lifts_missing(lifts: Sequence[float], pivots: Sequence[Pivot]) -> list[float]:
    """What needles go beyond their dials besides; of one that goes with its dial so far nothing unless surely."""
    return [pivot.told_lift if lift or pivot.is_lifted else 0.0 for lift, pivot in zip(lifts, pivots, strict=True)]


def any_lift_is_off(missing: Sequence[float]) -> bool:
    """Whether some needle goes another way than it was thought to, by more than lifts settle to."""
    return any(abs(lift) > SETTLED_LIFT for lift in missing)
