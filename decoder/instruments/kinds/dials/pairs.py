"""Pairs of needles that touch, cover or hide each other, in many frames at once.

The cascade is the thesis's: read the lower needle by its visible part; where the two nearly coincide, fit both
together; otherwise it is hidden under the upper one.
"""

from __future__ import annotations

import math

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, Found, Needle
from decoder.matching.pair_fit import PairFitter
from decoder.matching.strips import Strips
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_PAIR_CORRELATION, SLIVER_THRESHOLD, WHOLE_VISIBLE
from decoder.matching.uncovered_search import Candidate, Uncovered, UncoveredSearch
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

# Rows beyond what the windows need, since a fit may end some rows from where it starts.
SPARE_ROWS = 6


class TouchingPair:
    """Reads the two needles of one gauge where the upper one was found and the lower is near it.

    It does not handle gauges that are read all the way round or have tails.
    """

    def __init__(self, upper: Needle, lower: Needle) -> None:
        self._face = upper.face
        self._both_axes = upper.axis + lower.axis
        pixels_per_sample = upper.grid.pixels_per_sample
        self._search = UncoveredSearch(upper.template, lower.template, upper.face, lower.allowed, pixels_per_sample)
        self._fitter = PairFitter(upper.template, lower.template, pixels_per_sample)
        self._half_strip = self._search.reach_rows + lower.axis + SPARE_ROWS
        self.strip_rows = min(2 * self._half_strip + 1, len(upper.face))

    def top_rows(self, above_rows: Floats) -> Indices:
        """(M,): the first of the `strip_rows` rows to look at around each upper needle's row (M,)."""
        middle = np.rint(above_rows).astype(np.intp)
        top_rows: Indices = limited(middle - self._half_strip, 0, len(self._face) - self.strip_rows)
        return top_rows

    def is_beside(self, rows: Indices, scores: Floats, allowed: Mask, above_rows: Floats) -> Mask:
        """(M,): whether the lower needle is near the upper one, since it matches nowhere further away.

        Parameters
        ----------
        rows, allowed
            (N,): the gauge's rows that were searched, and whether the needle may be there.
        scores
            (M, N): the scores there.
        """
        far = np.abs(rows - above_rows[:, None]) > self._both_axes + 1
        peaks = far & allowed
        peaks[:, 1:-1] &= (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:])
        beside: Mask = scores.max(axis=1, where=peaks, initial=0.0) < LIKELY_SCORE
        return beside

    def read(self, pixels: Floats, top_rows: Indices, above: Found) -> tuple[Found, Found, Mask]:
        """Read upper and lower needle; also return where that converged.

        Parameters
        ----------
        pixels
            (M, S, C) float32: `strip_rows` rows of the gauge.
        top_rows
            (M,): where they begin.
        above
            The upper needle as it was found alone.
        """
        strips = Strips.of(pixels, top_rows, self._face)
        candidate = self._search.look(strips, above.row)
        every = np.arange(len(above.row))
        upper, lower = above.part(every), above.part(every)
        is_settled = np.ones(len(every), bool)
        # Least squares may move it by `MAX_PEAK_ROWS`; if that keeps it within reach, the two may coincide.
        apart_rows = np.abs(candidate.place - above.row)
        together = ~candidate.is_there | (apart_rows + MAX_PEAK_ROWS <= self._fitter.reach_rows)
        open_ = np.flatnonzero(~together)
        if open_.size:
            found = self._search.settle(strips.part(open_), candidate.part(open_))
            below, own = self._below(found, above.part(open_)), above.row[open_]
            apart_rows = np.abs(below.row - own)
            lower.put(open_, below)
            is_settled[open_] = found.is_settled
            is_lost = np.isin(below.status, (HIDDEN, MISSING))
            together[open_] = found.is_settled & (is_lost | (apart_rows <= self._fitter.reach_rows))
            apart = (below.status == READ) & (apart_rows > self._both_axes)
            touching = open_[found.is_settled & ~together[open_] & ~apart]
            if touching.size:
                one, other, settled = self._touching(strips.part(touching), above.part(touching), lower.part(touching))
                upper.put(touching, one)
                lower.put(touching, other)
                is_settled[touching] = settled
        where = np.flatnonzero(together)
        if where.size:
            elsewhere = np.isin(lower.status[where], (MISSING,))
            one, other = self._coinciding(strips.part(where), above.part(where), candidate.part(where), elsewhere)
            upper.put(where, one)
            lower.put(where, other)
        return upper, lower, is_settled

    def _below(self, found: Uncovered, above: Found) -> Found:
        """Return the lower needle as its visible part was read, or else as hidden or missing."""
        is_lost = ~(found.score >= SCORE_THRESHOLD)
        shows = (found.score >= LIKELY_SCORE) & (found.visible >= HALF)
        hidden = is_lost & ~shows
        status = np.where(is_lost, MISSING, np.where(found.visible >= WHOLE_VISIBLE, READ, EDGE))
        status = np.where(hidden, HIDDEN, status)
        concealed = self._hidden(above)
        return Found(
            status,
            np.where(hidden, concealed.row, found.row),
            np.where(hidden, concealed.sigma_rows, found.sigma_rows),
            np.where(hidden, concealed.score, found.score),
        )

    def _hidden(self, above: Found, doubt_rows: Floats | float = 0.0) -> Found:
        """Return the needle at its cover's place, with the uncertainty of where it may be without being seen."""
        sigma_rows = np.hypot(above.sigma_rows, np.maximum(self._fitter.hidden_reach_rows / math.sqrt(3.0), doubt_rows))
        return Found(np.full(len(above.row), HIDDEN), above.row, sigma_rows, above.score)

    def _touching(self, strips: Strips, above: Found, below: Found) -> tuple[Found, Found, Mask]:
        """Read each needle given what is known of the other."""
        over = self._fitter.over(strips, above.row, below.row)
        explained = np.isfinite(over.row) & (over.correlation >= WHOLE_VISIBLE)
        found = Found(above.status, over.row, over.sigma_rows, over.score)
        upper, lower = above.as_missing().instead(explained, found), below.part(np.arange(len(below.row)))
        is_settled = np.ones(len(below.row), bool)
        moved = np.flatnonzero(explained & _covers_other_pixels(above.row, upper.row))
        if moved.size:
            part = strips.part(moved)
            again = self._search.settle(part, self._search.look(part, upper.row[moved]))
            lower.put(moved, self._below(again, upper.part(moved)))
            is_settled[moved] = again.is_settled
        return upper, lower, is_settled

    def _coinciding(self, strips: Strips, above: Found, candidate: Candidate, elsewhere: Mask) -> tuple[Found, Found]:
        """Read both together, where there is too little room between them, or nothing better than a likely place.

        A lower needle that is likely to show `elsewhere` (M,) is not hidden.
        """
        pairs = self._fitter.fit(strips, above.row)
        explained = pairs.correlation >= WHOLE_VISIBLE
        together = Found(above.status, pairs.upper_row, pairs.upper_sigma_rows, pairs.upper_score)
        shows = explained & (pairs.lower_score >= SLIVER_THRESHOLD)
        hidden = explained & ~shows & (pairs.correlation >= MIN_PAIR_CORRELATION) & ~elsewhere
        upper = above.as_missing().instead(explained, together)
        sliver = Found(np.full(len(shows), EDGE), pairs.lower_row, pairs.lower_sigma_rows, pairs.lower_score)
        concealed = self._hidden(together, pairs.lower_doubt_rows)
        lower = above.as_missing().instead(hidden, concealed).instead(shows, sliver)
        lost = np.flatnonzero(~shows & ~hidden)
        if lost.size:
            found = self._search.settle(strips.part(lost), candidate.part(lost))
            lower.put(lost, self._below(found, above.part(lost)).as_missing())
        return upper, lower


def _covers_other_pixels(before: Floats, after: Floats) -> Mask:
    """Return where a needle that moved from one row to another touches different pixels."""
    moved: Mask = (np.floor(before) != np.floor(after)) | (np.ceil(before) != np.ceil(after))
    return moved
