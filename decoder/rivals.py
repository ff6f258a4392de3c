"""Rivals: whether a needle matches at another place of its dial nearly as well, so that its reading may be wrong.

A tail as long as the tip, a bug of the needle's form, or a reflection may match as the needle does. Where two places
cannot be told apart neither is believed.
"""

from __future__ import annotations

from dataclasses import dataclass

from decoder.arrays import Floats, Mask
from decoder.gauge_grid import opposite_rows, same_rows
from decoder.matching import MAX_PEAK_ROWS, Match, Matcher
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.unwrapping import PolarGrid

# A needle that matches elsewhere with no more than this times its own unexplained variance may be there instead.
CLEARLY_WORSE = 2.0
# So near that one reaches into the other's window, or right opposite, where there may be a tail that the template
# knows nothing of, scores say less.
DOUBTFUL_WORSE = 6.0
OPPOSITE_REACH_DEG = 4.0
# A place that matches less than this is no rival.
MIN_RIVAL = 0.7


@dataclass(frozen=True, slots=True)
class Rivals:
    """Looks for rivals on one gauge; `turn_rows` as in `gauge_grid.turn_rows`."""

    grid: PolarGrid
    turn_rows: float | None

    def any(self, matcher: Matcher, gauge: Floats, allowed: Mask, scores: Floats, match: Match) -> bool:
        """Whether there is one for a match on a gauge (R, C); `scores` (R,) are looked at on `allowed` rows (R,)."""
        if self._is_other_end(matcher, allowed, match):
            return True
        reach = matcher.half_width_rows + MAX_PEAK_ROWS
        elsewhere = allowed.copy()
        for row in same_rows(match.row, self.turn_rows):
            elsewhere[max(round(row - reach), 0) : max(round(row + reach) + 1, 0)] = False
        if scores.max(where=elsewhere, initial=0.0) < MIN_RIVAL:
            return False
        other = matcher.best(gauge, scores, elsewhere, scores)
        apart_rows = abs(other.row - match.row)
        clearly_worse = DOUBTFUL_WORSE if self._is_doubtful(apart_rows, matcher) else CLEARLY_WORSE
        return 1.0 - max(other.score, 0.0) ** 2 <= clearly_worse * (1.0 - match.score**2)

    def _is_other_end(self, matcher: Matcher, allowed: Mask, match: Match) -> bool:
        """Whether the needle may as well point the other way: what scores differ by is then the dial's, not its own."""
        there = [round(row) for row in opposite_rows(match.row, self.grid)]
        return any(allowed[row] for row in there if 0 <= row < len(allowed)) and matcher.template.has_like_ends

    def _is_doubtful(self, apart_rows: float, matcher: Matcher) -> bool:
        beside = apart_rows <= matcher.axis + matcher.half_width_rows
        opposite = abs(apart_rows * self.grid.step_deg - FULL_CIRCLE_DEG / 2) <= OPPOSITE_REACH_DEG
        return beside or (opposite and not self.grid.tail_columns)
