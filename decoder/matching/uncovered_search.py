"""The search for partly covered needles, in many frames at once, with the scores of `correlation`.

Only every third row near the covering needle is searched, with the pixels that this needle leaves uncovered.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from decoder.matching.correlation import face_moments, partial_normxcorr
from decoder.matching.needle_fit import Fits, WindowFitter, settle
from decoder.matching.needle_search import COARSE_STEP, peaks_of, thinned
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import Strips, UncoveredPixels
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.registration.thresholds import SCORE_THRESHOLD


@dataclass(frozen=True, slots=True)
class Uncovered:
    """A covered needle as found in M frames, (M,) each.

    Attributes
    ----------
    row, sigma_rows, score
        As in a `matching.Match`; the score is 0 where there is nothing.
    visible
        How much of the needle's contrast shows there.
    is_settled
        Whether the result is final: least squares converged, or it did not match to begin with.
    """

    row: Floats
    sigma_rows: Floats
    score: Floats
    visible: Floats
    is_settled: Mask


@dataclass(frozen=True, slots=True)
class Candidate:
    """Where to look closely for a covered needle in M frames; (M,) except for the last one.

    Attributes
    ----------
    above_row
        Of the covering needle.
    place
        The fractional row with the best score.
    score
        On the searched row there.
    is_there
        Whether the needle may be there at all.
    first_row
        The first of the searched rows.
    visible
        (M, J): how much of the needle's contrast shows on each of these.
    """

    above_row: Floats
    place: Floats
    score: Floats
    is_there: Mask
    first_row: Indices
    visible: Floats

    def part(self, which: Indices) -> Candidate:
        """Return those of some of the frames."""
        return Candidate(*(getattr(self, field.name)[which] for field in fields(self)))


class UncoveredSearch:
    """Searches for a needle near one that lies over it.

    Parameters
    ----------
    upper, lower
        Their templates.
    face
        (R, C) float32.
    allowed
        (R,): the rows on which the lower needle's axis may lie.
    pixels_per_sample
        That of the gauge's grid.
    """

    def __init__(
        self, upper: NeedleTemplate, lower: NeedleTemplate, face: Floats, allowed: Mask, pixels_per_sample: float
    ) -> None:
        self._axis = (lower.rows - 1) // 2
        self._upper_axis = (upper.rows - 1) // 2
        # as far as one reaches into the other's window, and one more searched row to see a peak there
        self.reach_rows = self._upper_axis + self._axis + 1 + COARSE_STEP
        self._face_rows = len(face)
        self._allowed = allowed
        self._fitter = WindowFitter([lower], [pixels_per_sample])
        coarse = thinned(lower)
        self._coarse = coarse
        self._whole = self._whole_contrast(face, coarse)
        self._steps = COARSE_STEP * np.arange(math.ceil(2 * self.reach_rows / COARSE_STEP) + 1) - self.reach_rows
        self._searched = COARSE_STEP * np.arange(len(self._steps) + coarse.rows - 1)
        self._left = UncoveredPixels(upper.touched, lower.rows)
        self._left_searched = UncoveredPixels(upper.touched, len(self._searched), COARSE_STEP)

    def look(self, strips: Strips, above_rows: Floats) -> Candidate:
        """Find where the needle matches best near the rows (M,) of the covering one's axis."""
        rows = np.rint(above_rows).astype(np.intp)[:, None] + self._steps
        scores, visible = self._scores(strips, rows, above_rows)
        inside = (rows >= self._axis) & (rows < self._face_rows - self._axis)
        visible = np.where(inside, visible, 0.0)
        may_be = inside & self._allowed[limited(rows, 0, self._face_rows - 1)] & (visible >= MIN_VISIBLE)
        where, scores = may_be, np.where(inside, scores, -1.0)
        where[:, 1:-1] &= (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:])
        where[:, [0, -1]] = False
        top, off = peaks_of(scores, where)
        every = np.arange(len(rows))
        place = rows[every, top] + COARSE_STEP * (off - top)
        return Candidate(above_rows, place, scores[every, top], where[every, top], rows[:, 0], visible)

    def settle(self, strips: Strips, candidate: Candidate) -> Uncovered:
        """Fit the needle near its candidate place by least squares of its uncovered pixels."""
        above_rows = candidate.above_row - self._upper_axis

        def fit(open_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
            seen, face = strips.part(open_).windows(rows, self._axis)
            masks = self._left.at(rows - self._axis, above_rows[open_])
            return self._fitter.fit(seen, face, guess_rows, masks=masks.reshape(seen.shape))

        found = settle(fit, candidate.place, (self._axis, self._face_rows - self._axis - 1), MAX_PEAK_ROWS)
        row = np.where(found.is_settled & candidate.is_there, found.row, candidate.above_row)
        score = np.where(candidate.is_there, np.where(found.is_settled, found.score, candidate.score), 0.0)
        every, last = np.arange(len(row)), candidate.visible.shape[1] - 1
        at = limited((row - candidate.first_row) / COARSE_STEP, 0.0, last - 0.001)
        first = at.astype(np.intp)
        shows = candidate.visible[every, first] * (1 - at + first) + candidate.visible[every, first + 1] * (at - first)
        # Where least squares fail, it is hidden if it did not even match, and otherwise left to other methods.
        return Uncovered(row, found.sigma_rows, score, shows, found.is_settled | (score < SCORE_THRESHOLD))

    def _scores(self, strips: Strips, rows: Indices, above_rows: Floats) -> tuple[Floats, Floats]:
        """Return scores and how much shows, on rows (M, J)."""
        first = rows[:, 0] - self._axis + self._axis % COARSE_STEP
        seen, face = strips.rows(first[:, None] + self._searched, COARSE_STEP)
        mask = self._left_searched.at(first, above_rows - self._upper_axis)
        scores, moments = partial_normxcorr(seen, face, self._coarse, mask)
        whole = self._whole[limited(rows, 0, self._face_rows - 1)]
        return scores, limited(moments.needle_contrast / np.maximum(whole, 1e-6), 0.0, 1.0)

    def _whole_contrast(self, face: Floats, coarse: NeedleTemplate) -> Floats:
        """(R,): the needle's contrast with nothing over it, by the row of its axis."""
        whole = np.zeros(len(face), np.float32)
        for phase in range(COARSE_STEP):
            contrast = face_moments(
                np.ascontiguousarray(face[phase::COARSE_STEP, ::COARSE_STEP]), coarse
            ).needle_contrast
            first = phase + self._axis - self._axis % COARSE_STEP
            rows = first + COARSE_STEP * np.arange(len(contrast))
            whole[rows[rows < len(face)]] = contrast[rows < len(face)]
        return whole
