"""Pairs of needles that touch, cover or hide each other, in many frames at once: the cascade of the gauge reader.

What is less than clear here, too, is left to the gauge reader: a reflection, a glare, needles that are lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited
from decoder.gauge_grid import rows_in_sweep
from decoder.gauge_reader import (
    HOPELESS_SCORE,
    MIN_HIDDEN_CORRELATION,
    MIN_TOUCHING_CORRELATION,
    SCORE_THRESHOLD,
    SLIVER_THRESHOLD,
)
from decoder.matching import MAX_PEAK_ROWS
from decoder.needle_pair import NeedlePair
from decoder.occlusion import WHOLE_VISIBLE
from decoder.quick_search import QuickNeedle
from decoder.reading import Status
from decoder.strips import Strips
from decoder.uncovered_search import Sought, Uncovered, UncoveredSearch

STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN, Status.MISSING)
READ, EDGE, HIDDEN, MISSING = range(4)
# So many rows more than the windows need: where a fit starts is not quite where it ends.
SPARE_ROWS = 6


@dataclass(frozen=True, slots=True)
class Needle:
    """One needle in M frames, (M,) each: `status` an index into `STATUSES`, the rest as of a `matching.Match`."""

    status: Indices
    row: Floats
    sigma_rows: Floats
    score: Floats

    def part(self, which: Indices) -> Needle:
        """In some of the frames."""
        return Needle(self.status[which], self.row[which], self.sigma_rows[which], self.score[which])

    def copy(self) -> Needle:
        """The same, with arrays of its own."""
        return self.part(np.arange(len(self.row)))

    def put(self, which: Indices, other: Needle) -> None:
        """What was found in some of the frames."""
        for name in ("status", "row", "sigma_rows", "score"):
            getattr(self, name)[which] = getattr(other, name)


class TouchingPair:
    """Reads the two needles of one gauge where the upper one was found, and the lower is near it.

    The gauge is neither read all the way round nor with tails; `pair` is what its gauge reader has of the two.
    """

    def __init__(self, upper: QuickNeedle, lower: QuickNeedle, pair: NeedlePair) -> None:
        one, other = pair.upper, pair.lower
        self._face = upper.face
        self._both_axes = one.axis + other.axis
        self._pair_reach = pair.reach_rows
        self._hidden_sigma_rows = pair.hidden_reach_rows / math.sqrt(3.0)
        pixels_per_sample = upper.grid.pixels_per_sample
        allowed = rows_in_sweep(lower.gauge, lower.grid)
        self._search = UncoveredSearch(upper.template, lower.template, upper.face, allowed, pixels_per_sample)
        self._fitter = pair.fitter(self._pair_reach)
        self._half_strip = self._search.reach_rows + other.axis + SPARE_ROWS
        self.strip_rows = min(2 * self._half_strip + 1, len(upper.face))

    def top_rows(self, above_rows: Floats) -> Indices:
        """(M,): where on the gauge the `strip_rows` begin that are looked at around the upper needle's row, (M,)."""
        middle = np.rint(above_rows).astype(np.intp)
        top_rows: Indices = limited(middle - self._half_strip, 0, len(self._face) - self.strip_rows)
        return top_rows

    def is_beside(self, rows: Indices, scores: Floats, allowed: Mask, above_rows: Floats) -> Mask:
        """(M,): where the lower needle matches nowhere further away.

        Parameters
        ----------
        rows, allowed
            (N,): the gauge's rows that were searched, and whether the needle may be there.
        scores
            (M, N): what was found on them.
        """
        far = np.abs(rows - above_rows[:, None]) > self._both_axes + 1
        peaks = far & allowed
        peaks[:, 1:-1] &= (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:])
        beside: Mask = scores.max(axis=1, where=peaks, initial=0.0) < HOPELESS_SCORE
        return beside

    def read(self, pixels: Floats, top_rows: Indices, above: Needle) -> tuple[Needle, Needle, Mask]:
        """Upper and lower needle, and where that is beyond doubt.

        Parameters
        ----------
        pixels
            (M, S, C) float32: so many rows of the gauge as `strip_rows` says.
        top_rows
            (M,): where they begin.
        above
            The upper needle as it is found alone.
        """
        strips = Strips.of(pixels, top_rows, self._face)
        sought = self._search.look(strips, above.row)
        upper, lower = above.copy(), above.copy()
        is_settled = np.ones(len(above.row), bool)
        # There or thereabouts: least squares do not move it further than this.
        apart_rows = np.abs(sought.top_row - above.row)
        together = ~sought.is_there | (apart_rows + MAX_PEAK_ROWS <= self._pair_reach)
        open_ = np.flatnonzero(~together)
        if open_.size:
            found = self._search.settled(strips.part(open_), sought.part(open_))
            below, own = self._below(found, above.part(open_)), above.row[open_]
            apart_rows = np.abs(below.row - own)
            lower.put(open_, below)
            is_settled[open_] = found.is_settled
            together[open_] = found.is_settled & ((below.status == HIDDEN) | (apart_rows <= self._pair_reach))
            apart = (below.status == READ) & (apart_rows > self._both_axes)
            touching = open_[found.is_settled & ~together[open_] & ~apart]
            if touching.size:
                one, other, settled = self._touching(strips.part(touching), above.part(touching), lower.part(touching))
                upper.put(touching, one)
                lower.put(touching, other)
                is_settled[touching] = settled
        where = np.flatnonzero(together)
        if where.size:
            one, other = self._coinciding(strips.part(where), above.part(where), sought.part(where))
            upper.put(where, one)
            lower.put(where, other)
        return upper, lower, is_settled

    def _below(self, found: Uncovered, above: Needle) -> Needle:
        """The lower needle as what shows of it tells; hidden if that is too little."""
        hidden = ~(found.score >= SCORE_THRESHOLD)
        status = np.where(hidden, HIDDEN, np.where(found.visible >= WHOLE_VISIBLE, READ, EDGE))
        concealed = self._hidden(above)
        return Needle(
            status,
            np.where(hidden, concealed.row, found.row),
            np.where(hidden, concealed.sigma_rows, found.sigma_rows),
            np.where(hidden, concealed.score, found.score),
        )

    def _hidden(self, above: Needle, doubt_rows: Floats | float = 0.0) -> Needle:
        """At the covering needle's place, give or take how far it may be without being seen, or told."""
        sigma_rows = np.hypot(above.sigma_rows, np.maximum(self._hidden_sigma_rows, doubt_rows))
        return Needle(np.full(len(above.row), HIDDEN), above.row, sigma_rows, above.score)

    def _touching(self, strips: Strips, above: Needle, below: Needle) -> tuple[Needle, Needle, Mask]:
        """Each with what is known of the other."""
        over = self._fitter.over(strips, above.row, below.row)
        explained = np.isfinite(over.row) & (over.fits.correlation >= MIN_TOUCHING_CORRELATION)
        upper = Needle(
            np.where(explained, above.status, MISSING),
            np.where(explained, over.row, above.row),
            np.where(explained, over.fits.sigma_rows, above.sigma_rows),
            np.where(explained, over.fits.score, above.score),
        )
        lower = below.copy()
        is_settled = np.ones(len(below.row), bool)
        moved = np.flatnonzero(explained & _covers_other_pixels(above.row, upper.row))
        if moved.size:
            part = strips.part(moved)
            found = self._search.settled(part, self._search.look(part, upper.row[moved]))
            lower.put(moved, self._below(found, upper.part(moved)))
            is_settled[moved] = found.is_settled
        return upper, lower, is_settled

    def _coinciding(self, strips: Strips, above: Needle, sought: Sought) -> tuple[Needle, Needle]:
        """With too little room between them to be read one after the other."""
        pairs = self._fitter.fit(strips, above.row)
        explained = pairs.correlation >= MIN_TOUCHING_CORRELATION
        together = Needle(above.status, pairs.upper_row, pairs.upper_sigma_rows, pairs.upper_score)
        shows = explained & (pairs.lower_score >= SLIVER_THRESHOLD)
        hidden = explained & ~shows & (pairs.correlation >= MIN_HIDDEN_CORRELATION)
        upper = _chosen(explained, together, _missing(above))
        sliver = Needle(np.full(len(shows), EDGE), pairs.lower_row, pairs.lower_sigma_rows, pairs.lower_score)
        concealed = self._hidden(together, pairs.lower_doubt_rows)
        lower = _chosen(shows, sliver, _chosen(hidden, concealed, _missing(above)))
        lost = np.flatnonzero(~shows & ~hidden)
        if lost.size:
            found = self._search.settled(strips.part(lost), sought.part(lost))
            lower.put(lost, _missing(self._below(found, above.part(lost))))
        return upper, lower


def _covers_other_pixels(before: Floats, after: Floats) -> Mask:
    """Where a needle that moved from one row to another touches other pixels."""
    moved: Mask = (np.floor(before) != np.floor(after)) | (np.ceil(before) != np.ceil(after))
    return moved


def _missing(needle: Needle) -> Needle:
    return Needle(np.full(len(needle.row), MISSING), needle.row, needle.sigma_rows, needle.score)


def _chosen(where: Mask, needle: Needle, otherwise: Needle) -> Needle:
    """The one needle in some of the frames, the other in the rest."""
    names = ("status", "row", "sigma_rows", "score")
    return Needle(*(np.where(where, getattr(needle, name), getattr(otherwise, name)) for name in names))
