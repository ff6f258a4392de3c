"""Two needles that nearly coincide, read together: the upper one over the lower one over the face.

Too little of the lower needle shows for a search of its own, but what shows still pulls at the upper one. So the
lower is tried at every place where it touches the upper, the upper is settled over it, and the pair that leaves least
unexplained is taken. The lower needle's score is that of what shows of it: how much of the pixels that upper needle
and face do not explain it does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from decoder.arrays import Floats
from decoder.correlation import parabola_peak
from decoder.matching import Match, Matcher, Settled
from decoder.needle_layer import shown_below

# The lower needle is tried this far apart at first, then row by row around the best.
COARSE_ROWS = 3
# A pixel shows the lower needle if that covers this much of it.
SHOWN_PART = 0.2
# What shows must be worth this many original pixels, or it may be anything.
MIN_SHOWN_PIXELS = 1.0
SURELY_SHOWN_PIXELS = 3.0
# A place for the lower needle must leave this much less unexplained than hiding it wholly, and than a mirrored pair.
MUCH_BETTER = 0.8
MIRROR_BETTER = 0.6
DIP = 0.9
HIDDEN_ROWS = 1.5
# A sliver is believed only where everything else is explained: a glare's edge beside a needle looks like one.
MIN_PAIR_CORRELATION = 0.98


@dataclass(frozen=True, slots=True)
class Pair:
    """The matches of two needles, the lower one's score being that of what shows of it.

    `correlation` is the NCC of the whole window with both needles over the face.
    """

    upper: Match
    lower: Match
    correlation: float


def fit_pair(gauge: Floats, upper: Matcher, upper_match: Match, lower: Matcher, reach: int) -> Pair:
    """The best pair near the upper needle's match.

    Parameters
    ----------
    gauge
        (R, C) float32, unwrapped.
    upper_match
        Where the upper needle was found, about.
    reach
        How many rows apart the two axes are tried.
    """
    middle = round(upper_match.row)
    noise = np.full(2 * reach + 1, np.inf)
    upper_rows = np.full(len(noise), np.nan)
    seen: set[int] = set()

    def look(indices: Iterable[int]) -> None:
        for index in set(indices) - seen:
            if 0 <= index < len(noise):
                noise[index], upper_rows[index] = upper.noise_over(
                    gauge, middle, lower.template, middle - reach + index
                )
                seen.add(index)

    look(range(reach % COARSE_ROWS, len(noise), COARSE_ROWS))
    best = -1
    while best != (best := int(noise.argmin())):  # until the best row's neighbours are no better
        look(range(best - COARSE_ROWS + 1, best + COARSE_ROWS))
    if not np.isfinite(noise[best]):
        return Pair(upper_match, Match(upper_match.row, math.inf, 0.0), 0.0)
    place = middle - reach + parabola_peak(-noise, best)
    settled = upper.again(gauge, upper_match, lower.template, place)
    if settled is None:
        return Pair(upper_match, Match(upper_match.row, math.inf, 0.0), 0.0)
    apart = (middle - reach + np.arange(len(noise)) - settled.match.row) * np.sign(place - settled.match.row)
    is_better = noise[best] <= _noise_to_beat(noise, apart)
    score = _score(upper, lower, place, settled) if is_better else 0.0
    match = Match(place, _spread_rows(noise, best, upper), score)
    rivals = upper_rows[noise * MIRROR_BETTER <= noise[best]]  # where else the upper needle may be
    doubt_rows = float(np.nanmax(np.abs(rivals - settled.match.row), initial=0.0))
    sigma_rows = math.hypot(settled.match.sigma_rows, doubt_rows)
    return Pair(replace(settled.match, sigma_rows=sigma_rows), match, settled.fit.correlation)


def _noise_to_beat(noise: Floats, apart: Floats) -> float:
    """What a place of the lower needle may leave unexplained to be believed.

    `apart` is how far each tried place lies from the upper needle, positive on the side in question. Hiding the
    needle wholly must explain clearly less; a place on the other side that explains more than that is a mirrored
    pair, and must be beaten by far.
    """
    hidden = noise[np.abs(apart) <= HIDDEN_ROWS].min(initial=np.inf)
    mirrored = noise[apart < -HIDDEN_ROWS].min(initial=np.inf)
    return float(min(MUCH_BETTER * hidden, (MIRROR_BETTER if mirrored < DIP * hidden else MUCH_BETTER) * mirrored))


def pair_reach_rows(upper: Matcher, lower: Matcher) -> int:
    """How far apart two needles' axes are tried."""
    return math.ceil((upper.half_width_rows + lower.half_width_rows) / 2) + 2


def hidden_reach_rows(upper: Matcher, lower: Matcher) -> float:
    """How far apart two needles' axes can be with too little of the lower one showing to tell."""
    for rows in range(upper.axis):
        if any(
            _shown_pixels(upper, shown_below(upper.template, lower.template, float(upper.axis + side))[0])
            >= SURELY_SHOWN_PIXELS
            for side in (-rows, rows)
        ):
            return float(rows)
    return float(upper.axis)


def _shown_pixels(upper: Matcher, shown: Floats) -> float:
    """What shows of a needle, in original pixels."""
    return float(shown[shown > SHOWN_PART].sum()) * upper.pixels_per_sample


def _score(upper: Matcher, lower: Matcher, place: float, settled: Settled) -> float:
    """How well what shows of the lower needle explains what upper needle and face leave there, as a correlation."""
    shown, light = shown_below(upper.template, lower.template, place - (settled.row - upper.axis))
    where = shown > SHOWN_PART
    if settled.fit.correlation < MIN_PAIR_CORRELATION:
        return 0.0
    if _shown_pixels(upper, shown) < MIN_SHOWN_PIXELS:
        return 0.0
    added = settled.fit.gain * (light - upper.face_around(settled.row) * shown)[where]
    left = settled.fit.unexplained[where]
    without = left + added
    return math.sqrt(max(1.0 - float((left**2).sum()) / max(float((without**2).sum()), 1e-9), 0.0))


def _spread_rows(noise: Floats, best: int, upper: Matcher) -> float:
    """The spread of the lower needle's place from the bend of what is left unexplained."""
    if not 0 < best < len(noise) - 1 or not np.isfinite(noise[best - 1 : best + 2]).all():
        return 1.0
    bend = float(noise[best - 1] - 2 * noise[best] + noise[best + 1])
    return math.sqrt(2 * float(noise[best]) / max(bend * upper.independent_pixels, 1e-9))
