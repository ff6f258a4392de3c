"""What a round of the fit says of pivots: which are moved on, which are right, and how surely they end.

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
    return path.on(pivot.offset_px, others_px) if pivot.tilts else path.to(others_px)


def ended(pivot: Pivot, first_px: tuple[float, float], path: PivotPath) -> Pivot:
    """A moved pivot as uncertain as its path leaves it."""
    settled = pivot.settled(first_px, path.moved_px)
    return settled.unsettled() if is_off(pivot, was_moved=True) else settled


def is_off(pivot: Pivot, *, was_moved: bool) -> bool:
    """Whether needles turn elsewhere: surely, and further off than is drawn; after a step, than it settles to."""
    distance_px = math.hypot(*pivot.offset_px)
    return distance_px > SETTLED_PX if was_moved else distance_px > DRAWN_PX and pivot.is_certain
