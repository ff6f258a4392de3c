"""Several pointers of one value, as the three of an altimeter: the coarse ones count the turns of the finer.

Each pointer tells the value but for whole turns of it. The coarsest tells it roughly and in full; each finer one must
point, within a tolerance, where that puts it, and then says it better. Where two of them disagree there is no value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.flight_data import CODE, NOWHERE, NeedleSeries
from decoder.quantity import Combination
from decoder.reading import Status
from decoder.scale import in_turn, shortest

SEEN_STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN)
# A coarse pointer must tell the turns apart even if it is off by so many of its sigmas.
SURE_SIGMAS = 2.0


def combine(combination: Combination, parts: Sequence[NeedleSeries]) -> tuple[NeedleSeries, Mask]:
    """The value that pointers show together, and where they contradict each other, (N,).

    `parts` are the pointers' series, the finest first. Value, sigma and status are the finest one's, the score is the
    lowest of all; where one is missing or they disagree the value is missing.
    """
    finest = parts[0]
    seen: Mask = np.all([part.has(*SEEN_STATUSES) for part in parts], axis=0)
    value, agree = parts[-1].value, np.ones_like(seen)
    for finer, coarser in zip(parts[-2::-1], parts[:0:-1], strict=True):
        off, agrees = _step(finer, coarser, value, combination.tolerance)
        value, agree = value + off, agree & agrees
    valued = seen & agree
    series = replace(
        finest,
        quantity=combination.quantity,
        status=np.where(valued, finest.status, CODE[Status.MISSING]).astype(np.uint8),
        value=np.where(valued, in_turn(value, combination.turn, combination.quantity.lowest), NOWHERE),
        sigma=np.where(valued, finest.sigma, NOWHERE),
        score=np.min([part.score for part in parts], axis=0),
    )
    return series, seen & ~agree


def _step(finer: NeedleSeries, coarser: NeedleSeries, value: Floats, tolerance: float) -> tuple[Floats, Mask]:
    """How far a finer pointer is from where the value so far puts it, the short way round, and whether that may be."""
    turn = finer.quantity.wraps
    assert turn is not None  # noqa: S101 - the panel takes no other pointers
    off = shortest(finer.value - value, turn)
    doubt = np.abs(off) + SURE_SIGMAS * np.hypot(coarser.sigma, finer.sigma)
    return off, (np.abs(off) <= tolerance * turn) & (doubt < turn / 2)
