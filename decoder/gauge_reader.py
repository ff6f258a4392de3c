"""The gauge reader: all needles of one unwrapped gauge, the covering ones before those they cover."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from decoder.arrays import Floats
from decoder.clutter import MIN_VISIBLE as MIN_CLEAR
from decoder.clutter import without_clutter
from decoder.gauge import Gauge
from decoder.gauge_grid import needle_places, opposite_rows, rows_in_sweep, same_rows, turn_rows
from decoder.glare import ThroughGlare
from decoder.matching import MAX_PEAK_ROWS, Match, Matcher
from decoder.method import Method
from decoder.needle_pair import NeedlePair
from decoder.needle_template import NeedleTemplate
from decoder.occlusion import MIN_VISIBLE, WHOLE_VISIBLE
from decoder.pair_fit import Pairs
from decoder.reading import Reading, Status
from decoder.rivals import Rivals
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.stack_reader import StackReader
from decoder.strips import Strips
from decoder.unwrapping import PolarGrid, UnwrappedGauge

# Found by trial in the thesis (3.2.3), and by others for infrared targets.
SCORE_THRESHOLD = 0.8
# The sliver of a needle that nearly coincides with another is few pixels: it must match better than a whole needle.
SLIVER_THRESHOLD = 0.85
# A needle whose searched score is this low nowhere matches well enough once it is settled.
HOPELESS_SCORE = 0.5
# A place at which another needle of the gauge matches better is that needle's.
RIVAL_REACH_DEG = 3.0
# A needle is hidden only if what covers it is seen clearly; under a glare it may be anywhere.
MIN_HIDDEN_CORRELATION = 0.98
# Where two needles touch, a reading that leaves more than this unexplained has taken one for part of the other.
MIN_TOUCHING_CORRELATION = 0.97
# Where needle and smooth light explain so much, or white drowns some of it, there is no clutter to look for.
EXPLAINED_SCORE = 0.95
# What a covering needle matches at least with another one beside it.
MIN_BESIDE_SCORE = 0.4


# So many needles on one dial are read by what is known of all the others.
STACKED = 3


@dataclass(frozen=True, slots=True)
class _Found:
    """One needle's match, and how it came about."""

    match: Match
    status: Status


class GaugeReader:
    """Reads the needles of one gauge.

    Parameters
    ----------
    gauge
        From the panel.
    grid
        Of its unwrapped form, see `gauge_grid`.
    templates
        One for each needle of the gauge, by name.
    face
        (rows, columns) float32: the unwrapped dial without needles.
    evenly_lit_score
        See `Tuning`.

    Attributes
    ----------
    pairs
        By the name of the lower needle, those of which one turns above the other.
    """

    def __init__(
        self,
        gauge: Gauge,
        grid: PolarGrid,
        templates: Mapping[str, NeedleTemplate],
        face: UnwrappedGauge,
        method: Method,
        *,
        evenly_lit_score: float,
    ) -> None:
        self._evenly_lit_score = evenly_lit_score
        self._grid = grid
        self._face = face
        self._matchers = {name: Matcher(template, grid.pixels_per_sample, face) for name, template in templates.items()}
        self._covers = {needle.name: needle.covered_by for needle in gauge.needles}
        self._order = _covering_first(self._covers)
        self.pairs = {
            name: NeedlePair(self._matchers[cover], self._matchers[name])
            for name, cover in self._covers.items()
            if cover is not None
        }
        self._allowed = rows_in_sweep(gauge, grid)
        self._turn_rows = turn_rows(gauge, grid)
        self._first_deg = gauge.sweep[0]
        self._rivals = Rivals(grid, self._turn_rows)
        self._rival_rows = round(RIVAL_REACH_DEG / grid.step_deg)
        alone = method is Method.NORMXCORR and len(templates) == 1
        self._through_glare = {
            name: ThroughGlare(template, grid.pixels_per_sample, face)
            for name, template in (templates if alone else {}).items()
        }
        self._method = method
        is_stack = method is Method.NORMXCORR and len(templates) >= STACKED
        self._stack = StackReader(gauge, grid, templates, face) if is_stack else None

    def read(self, unwrapped: UnwrappedGauge, scores: Mapping[str, Floats]) -> dict[str, Reading]:
        """The readings by needle.

        Parameters
        ----------
        unwrapped
            (R, C) float32 of the gauge's grid.
        scores
            (R,) each, by needle, from `searching`.
        """
        if self._stack is not None:
            return self._stack.read(unwrapped)
        found: dict[str, _Found] = {}
        for name in self._order:
            cover = self._covers[name]
            if cover is None or self._method is Method.XCORR:
                found[name] = self._read_free(unwrapped, name, scores)
                continue
            if found[cover].status is Status.MISSING:
                found[cover] = self._read_over(unwrapped, name, cover, scores)
            if found[cover].status is Status.MISSING:
                found[name] = self._read_free(unwrapped, name, scores)
            else:
                found |= self._read_pair(unwrapped, name, cover, found[cover], scores[name])
        return {name: self._reading(found[name]) for name in self._covers}

    def unread(self) -> dict[str, Reading]:
        """What is to be said of the needles of a gauge that does not lie in the frame."""
        return {name: Reading(Status.MISSING, math.nan, math.inf, 0.0) for name in self._covers}

    def _read_free(self, unwrapped: UnwrappedGauge, name: str, scores: Mapping[str, Floats]) -> _Found:
        """A needle on its own, wherever no other needle of the gauge matches better."""
        matcher, own = self._matchers[name], scores[name]
        curve = own if self._method is Method.NORMXCORR else matcher.products(unwrapped)
        allowed = self._allowed
        for other in self._matchers:
            if other != name:
                allowed = allowed & (own >= self._nearby_best(scores[other]))
        match = matcher.best(unwrapped, curve, allowed, own)
        if match.score >= SCORE_THRESHOLD and self._rivals.any(matcher, unwrapped, allowed, own, match):
            return _Found(match, Status.MISSING)
        if match.score >= self._evenly_lit_score or name not in self._through_glare:
            return _Found(match, Status.READ if match.score >= SCORE_THRESHOLD else Status.MISSING)
        seen = self._through_glare[name].find(unwrapped, self._allowed)
        glaring = seen.score >= SCORE_THRESHOLD and seen.visible < WHOLE_VISIBLE
        explained = max(seen.score, match.score) >= min(self._evenly_lit_score, EXPLAINED_SCORE)
        beside = None if glaring or explained else without_clutter(matcher, unwrapped, match)
        if beside is not None and beside.visible >= MIN_CLEAR and beside.match.score >= self._evenly_lit_score:
            return _Found(beside.match, Status.READ if beside.visible >= WHOLE_VISIBLE else Status.EDGE)
        if seen.score >= match.score:
            match = Match(seen.row, seen.sigma_rows, seen.score)
        if match.score < SCORE_THRESHOLD:
            return _Found(match, Status.MISSING)
        drowned = abs(seen.row - match.row) <= MAX_PEAK_ROWS and seen.visible < WHOLE_VISIBLE
        return _Found(match, Status.EDGE if drowned else Status.READ)

    def _nearby_best(self, scores: Floats) -> Floats:
        """The best score within `RIVAL_REACH_DEG` of each row."""
        window = np.ones((2 * self._rival_rows + 1, 1), np.uint8)
        best: Floats = np.asarray(cv2.dilate(scores[:, None], window)[:, 0], np.float32)
        return best

    def _read_over(self, unwrapped: UnwrappedGauge, name: str, cover: str, scores: Mapping[str, Floats]) -> _Found:
        """A covering needle that does not match alone, because the one below shows beside it: both together."""
        upper, lower = self._matchers[cover], self._matchers[name]
        alone = upper.best(unwrapped, scores[cover], self._allowed, scores[cover])
        if alone.score < MIN_BESIDE_SCORE:
            return _Found(alone, Status.MISSING)
        pair = self._fit_pair(unwrapped, name, alone, reach_rows=upper.axis + lower.axis // 2)
        explained = pair.correlation[0] >= MIN_HIDDEN_CORRELATION and pair.lower_score[0] >= SLIVER_THRESHOLD
        if explained and pair.upper_score[0] >= SCORE_THRESHOLD:
            return _Found(_upper(pair), Status.READ)
        return _Found(alone, Status.MISSING)

    def _read_below(self, unwrapped: UnwrappedGauge, name: str, cover: str, above: _Found, scores: Floats) -> _Found:
        """The cascade for a needle whose covering needle has been read; `scores` (R,) are those of all its pixels."""
        matcher, upper = self._matchers[name], self._matchers[cover]
        covers = same_rows(above.match.row, self._turn_rows) + opposite_rows(above.match.row, self._grid)
        distances = [np.abs(np.arange(len(scores)) - row) for row in covers]
        far = np.min(distances, axis=0) > upper.axis + matcher.axis + 1
        allowed = self._allowed & far
        if scores.max(where=allowed, initial=0.0) >= HOPELESS_SCORE:
            match = matcher.best(unwrapped, scores, allowed, scores)
            if match.score >= SCORE_THRESHOLD:
                twice = self._rivals.any(matcher, unwrapped, allowed, scores, match)
                return _Found(match, Status.MISSING if twice else Status.READ)
        mask = (~needle_places(self._grid, upper.touched, above.match.row, self._turn_rows)).astype(np.float32)
        seen = matcher.uncovered(unwrapped, mask, scores, covers, upper.axis)
        match = matcher.best(unwrapped, seen.scores, self._allowed & (seen.visible >= MIN_VISIBLE), seen.scores, mask)
        if match.score < SCORE_THRESHOLD:
            return self._hidden(name, above)
        return _Found(match, Status.READ if seen.visible[round(match.row)] >= WHOLE_VISIBLE else Status.EDGE)

    def _read_pair(
        self, unwrapped: UnwrappedGauge, name: str, cover: str, above: _Found, scores: Floats
    ) -> dict[str, _Found]:
        """A needle below another; where they touch, both are read together, or each with what is known of the other."""
        below = self._near(self._read_below(unwrapped, name, cover, above, scores), above)
        lower, upper = self._matchers[name], self._matchers[cover]
        apart_rows = abs(below.match.row - above.match.row)
        if below.status is Status.READ and apart_rows > upper.axis + lower.axis:
            return {name: below, cover: above}
        if below.status is Status.HIDDEN or apart_rows <= self.pairs[name].reach_rows:
            return self._read_coinciding(unwrapped, name, cover, above, below)
        settled = upper.again(unwrapped, above.match, lower.template, below.match.row)
        if settled is None or settled.fit.correlation < MIN_TOUCHING_CORRELATION:
            return {name: below, cover: _Found(above.match, Status.MISSING)}
        above = _Found(settled.match, above.status)
        return {name: self._read_below(unwrapped, name, cover, above, scores), cover: above}

    def _read_coinciding(
        self, unwrapped: UnwrappedGauge, name: str, cover: str, above: _Found, below: _Found
    ) -> dict[str, _Found]:
        """Two needles with too little room between them to be read one after the other."""
        pair = self._fit_pair(unwrapped, name, above.match, reach_rows=self.pairs[name].reach_rows)
        lost, correlation = _Found(below.match, Status.MISSING), pair.correlation[0]
        if correlation < MIN_TOUCHING_CORRELATION:
            return {name: lost, cover: _Found(above.match, Status.MISSING)}
        above = _Found(_upper(pair), above.status)
        if pair.lower_score[0] >= SLIVER_THRESHOLD:
            sliver = Match(float(pair.lower_row[0]), float(pair.lower_sigma_rows[0]), float(pair.lower_score[0]))
            return {name: _Found(sliver, Status.EDGE), cover: above}
        if correlation < MIN_HIDDEN_CORRELATION:
            return {name: lost, cover: above}
        return {name: self._hidden(name, above, float(pair.lower_doubt_rows[0])), cover: above}

    def _fit_pair(self, unwrapped: UnwrappedGauge, name: str, above: Match, *, reach_rows: int) -> Pairs:
        """The best pair of a needle and its cover near where that was found."""
        strips = Strips.of(unwrapped[None], np.zeros(1, np.intp), self._face)
        return self.pairs[name].fitter(reach_rows).fit(strips, np.array([above.row]))

    def _near(self, below: _Found, above: _Found) -> _Found:
        """A needle at the row next to the covering one's of all rows that are its place on a round dial."""
        rows = same_rows(below.match.row, self._turn_rows)
        nearest = min(rows, key=lambda row: abs(row - above.match.row))
        return replace(below, match=replace(below.match, row=nearest))

    def _hidden(self, name: str, above: _Found, doubt_rows: float = 0.0) -> _Found:
        """At the covering needle's place, give or take how far from it the needle could be without being told."""
        off_rows = max(self.pairs[name].hidden_reach_rows / math.sqrt(3.0), doubt_rows)
        sigma_rows = math.hypot(above.match.sigma_rows, off_rows)
        return _Found(Match(above.match.row, sigma_rows, above.match.score), Status.HIDDEN)

    def _reading(self, found: _Found) -> Reading:
        match = found.match
        angle_deg = self._grid.angle_deg(match.row)
        if self._turn_rows is not None:
            angle_deg = self._first_deg + (angle_deg - self._first_deg) % FULL_CIRCLE_DEG
        return Reading(found.status, angle_deg, match.sigma_rows * self._grid.step_deg, match.score)


def _upper(pair: Pairs) -> Match:
    return Match(float(pair.upper_row[0]), float(pair.upper_sigma_rows[0]), float(pair.upper_score[0]))


def _covering_first(covers: Mapping[str, str | None]) -> Sequence[str]:
    def depth(name: str) -> int:
        cover = covers[name]
        return 0 if cover is None else 1 + depth(cover)

    return sorted(covers, key=depth)
