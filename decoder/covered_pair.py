"""Two needles that nearly coincide, read together: the upper one over the lower one over the face.

Too little of the lower needle shows for a search of its own, but what shows still pulls at the upper one. So the lower is
tried at every place where it touches the upper, the upper is settled over it, and the pair that leaves least unexplained is
taken. The lower needle's score is the partial correlation of what shows of it: how much better the gauge is explained with it
there than with it hidden wholly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.correlation import parabola_peak
from decoder.matching import Match, Matcher, Settled

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Pair:
    """The matches of two needles, the lower one's score being that of what shows of it."""

    upper: Match
    lower: Match


def fit_pair(gauge: Floats, upper: Matcher, upper_match: Match, lower: Matcher) -> Pair:
    """The best pair near the upper needle's match; `gauge` is (R, C) float32, unwrapped."""
    reach = math.ceil((upper.half_width_rows + lower.half_width_rows) / 2) + 2
    middle = round(upper_match.row)
    offsets = np.arange(-reach, reach + 1)
    tried: list[Settled] = [
        upper.again(gauge, upper_match, lower.template, float(middle + offset)) for offset in offsets
    ]
    noise = np.array([settled.noise for settled in tried])
    hidden = float(noise[np.abs(offsets) <= 1].min())
    best = int(noise.argmin())
    if not np.isfinite(hidden) or hidden <= 0:
        return Pair(upper_match, Match(upper_match.row, math.inf, 0.0))
    score = math.sqrt(max(1.0 - float(noise[best]) / hidden, 0.0))
    place = middle - reach + parabola_peak((-noise).astype(np.float32), best)
    settled = upper.again(gauge, upper_match, lower.template, place)
    return Pair(settled.match, Match(place, _spread_rows(noise, best, upper), score))


def _spread_rows(noise: NDArray[np.float64], best: int, upper: Matcher) -> float:
    """The spread of the lower needle's place from the bend of what is left unexplained."""
    if not 0 < best < len(noise) - 1:
        return 1.0
    bend = float(noise[best - 1] - 2 * noise[best] + noise[best + 1])
    return math.sqrt(2 * float(noise[best]) / max(bend * upper.independent_pixels, 1e-9))
