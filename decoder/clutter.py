"""Reading beside clutter: a bug or a line at the needle's side is left out of the sums that place the needle.

Least squares give a thing that neither needle nor face explains its share of the reading. Where a needle does not
match as it should, the pixels that it leaves far from explained are left out, and it is placed again, until nothing
changes. What is left must hold most of the needle, and match as any needle must.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from decoder.arrays import Floats
from decoder.fitting import MAX_FRACTION_ROWS, Fit
from decoder.matching import MAX_PEAK_ROWS, Match, Matcher
from decoder.sorting import middle_of

# Clutter must leave this much of a needle's contrast to place it by.
MIN_VISIBLE = 0.7
STEPS = 4
MAD_TO_SIGMA = 1.4826
OUTLIER_SPREADS = 3.0
# Camera and JPEG leave this much unexplained wherever a needle's edge is; less is no clutter.
MIN_SPREAD_LEVELS = 5.0


@dataclass(frozen=True, slots=True)
class SeenBeside:
    """A match without the clutter, and which part of the needle's contrast it rests on."""

    match: Match
    visible: float


def without_clutter(matcher: Matcher, gauge: Floats, match: Match) -> SeenBeside | None:
    """The needle near a match on a gauge (R, C), what is far from explained left out; None where it gets lost."""
    row, seen = round(match.row), None
    guess_rows = match.row - row
    mask = None
    for _ in range(STEPS):
        rows = matcher.window(row, len(gauge))
        if rows is None:
            return None
        face = matcher.face_around(row)
        fit = matcher.fitter.fit(gauge[rows], partial(_bare, face), mask, guess_rows=guess_rows)
        place = row + fit.fraction
        if not abs(place - match.row) <= MAX_PEAK_ROWS:
            return None
        if abs(fit.fraction) > MAX_FRACTION_ROWS:
            row, guess_rows, mask = round(place), 0.0, None
            continue
        seen = SeenBeside(Match(place, fit.sigma_rows, fit.score), _visible(matcher, face, mask))
        mask, guess_rows = _explained(matcher, fit), fit.fraction
    return seen


def _bare(face: Floats, _: Floats) -> Floats:
    return face


def _explained(matcher: Matcher, fit: Fit) -> Floats:
    """(H, C): 1 where needle and face explain the pixel, 0 elsewhere."""
    off = np.abs(fit.unexplained)
    spread = MAD_TO_SIGMA * float(middle_of(off[matcher.template.trust > 0]))
    return (off <= OUTLIER_SPREADS * max(spread, MIN_SPREAD_LEVELS)).astype(np.float32)


def _visible(matcher: Matcher, face: Floats, mask: Floats | None) -> float:
    template = matcher.template
    contrast = template.trust * (template.light + (template.transparency - 1.0) * face) ** 2
    return 1.0 if mask is None else float((contrast * mask).sum() / max(float(contrast.sum()), 1e-9))
