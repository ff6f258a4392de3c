"""Matching: where a needle's template fits an unwrapped gauge best, to a fraction of a row, and how surely.

The best row comes from the correlation; least squares on the pixels there gives the fraction (the maximum of the NCC
between rows), and what it leaves unexplained gives the uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from operator import itemgetter

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.correlation import parabola_peak, xcorr
from decoder.fitting import MAX_FRACTION_ROWS, Fit, Fitter
from decoder.lower_layer import LowerNeedle
from decoder.needle_template import NeedleTemplate
from decoder.occlusion import Visibility, uncovered_scores
from decoder.over_face import FaceMoments, face_moments
from decoder.searching import COARSE_STEP, thinned

# The best row of a blurred needle may be one beside its true place.
MAX_PEAK_ROWS = 3.0
MAX_STEPS = 4


@dataclass(frozen=True, slots=True)
class Match:
    """A template's place on an unwrapped gauge: the row of its axis, the spread of that, and the NCC there."""

    row: float
    sigma_rows: float
    score: float


NO_MATCH = Match(0.0, float("inf"), 0.0)


@dataclass(frozen=True, slots=True)
class Settled:
    """A match, and the fit that it came from in the window around `row`."""

    match: Match
    row: int
    fit: Fit


class Matcher:
    """One template, with all that depends on it alone worked out once.

    Parameters
    ----------
    template
        The needle.
    pixels_per_sample
        How much of an original pixel one sample of the unwrapped gauge stands for: neighbouring samples share their
        noise.
    face
        (R, C) float32: the dial without needles.
    """

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float, face: Floats) -> None:
        self.template = template
        self._face = face
        self.axis = (template.rows - 1) // 2
        self._moments: dict[int, FaceMoments] = {}
        self.fitter = Fitter(template, pixels_per_sample)
        self.pixels_per_sample = pixels_per_sample
        self.half_width_rows = template.half_width_deg / template.step_deg

    @property
    def touched(self) -> Mask:
        """The template's."""
        return self.template.touched

    def uncovered(
        self, gauge: Floats, mask: Floats, scores: Floats, cover_rows: Sequence[float], cover_axis: int
    ) -> Visibility:
        """Scores of the pixels that `mask` (R, C) leaves, and how much of the needle they show; both (R,).

        Away from the covering needle, whose axis lies on each of `cover_rows` in a template that reaches `cover_axis`
        rows to either side, these are the `scores` (R,) of all pixels.
        """
        left = Visibility(scores.copy(), np.ones_like(scores))
        left.visible[: self.axis] = left.visible[len(gauge) - self.axis :] = 0.0
        reach = cover_axis + self.axis + 1
        for cover_row in cover_rows:
            first = max(round(cover_row) - reach, self.axis)
            last = min(round(cover_row) + reach, len(gauge) - self.axis)
            if first >= last:
                continue
            last += (first - last) % COARSE_STEP + 1  # one searched row more, for the rows before it
            last = min(last, len(gauge) - self.axis)
            skip = self.axis % COARSE_STEP
            rows = slice(first - self.axis + skip, last + self.axis - skip, COARSE_STEP)
            seen, face, open_to_view = (image[rows, ::COARSE_STEP] for image in (gauge, self._face, mask))
            near = uncovered_scores(seen, face, open_to_view, self._coarse, self._whole(rows))
            inner = np.arange(first, last)
            searched = inner[::COARSE_STEP][: len(near.scores)]
            left.scores[inner] = np.interp(inner, searched, near.scores)
            left.visible[inner] = np.interp(inner, searched, near.visible)
        return left

    def products(self, gauge: Floats) -> Floats:
        """Plain cross-correlation with the template's axis on each row of (R, C): (R,) float32."""
        return self._padded(xcorr(gauge, self.template.pixels), gauge.shape[0])

    def best(self, gauge: Floats, curve: Floats, allowed: Mask, scores: Floats, mask: Floats | None = None) -> Match:
        """The match at the highest peak of `curve` on an allowed row, its score taken from `scores`; all (R,).

        A highest row whose neighbour is higher but not allowed is no peak: what is there lies elsewhere. Where `mask`,
        (R, C), is 0 the gauge's pixels are left out of the least squares.
        """
        top = self._highest_peak(curve, allowed)
        if top is None:
            return NO_MATCH
        # The rows between those that were searched lie on straight lines: the peak is that of the searched ones.
        phase = top % COARSE_STEP
        place = parabola_peak(curve[phase::COARSE_STEP], top // COARSE_STEP) * COARSE_STEP + phase
        row = self._within(round(place), len(gauge))
        guess_rows = min(max(place - row, -0.5), 0.5)
        settled = []
        for _ in range(MAX_STEPS):
            rows = slice(row - self.axis, row + self.axis + 1)
            behind = partial(_bare, self._face[rows])
            fit = self.fitter.fit(gauge[rows], behind, None if mask is None else mask[rows], guess_rows=guess_rows)
            if not abs(row + fit.fraction - top) <= MAX_PEAK_ROWS:
                break
            settled.append((abs(fit.fraction), row, fit))
            if abs(fit.fraction) <= MAX_FRACTION_ROWS:
                break
            row, guess_rows = self._within(row + round(fit.fraction), len(gauge)), 0.0
        if not settled:
            return Match(parabola_peak(curve, top), NO_MATCH.sigma_rows, float(scores[top]))
        _, row, fit = min(settled, key=itemgetter(0))
        return Match(row + fit.fraction, fit.sigma_rows, fit.score)

    def _highest_peak(self, curve: Floats, allowed: Mask) -> int | None:
        """The allowed row with the highest value that has no higher neighbour."""
        highest = int(np.where(allowed, curve, -np.inf).argmax())
        here = curve[highest]
        inner = self.axis <= highest < len(curve) - self.axis and 0 < highest < len(curve) - 1
        if inner and allowed[highest] and curve[highest - 1] <= here >= curve[highest + 1]:
            return highest  # as a rule; a rule that saves most of the work below
        peaks = allowed.copy()
        peaks[1:] &= curve[1:] >= curve[:-1]
        peaks[:-1] &= curve[:-1] >= curve[1:]
        peaks[: self.axis] = peaks[len(curve) - self.axis :] = False
        return int(np.where(peaks, curve, -np.inf).argmax()) if peaks.any() else None

    def _within(self, row: int, rows: int) -> int:
        """The row nearest to this one around which the template lies on the gauge."""
        return min(max(row, self.axis), rows - self.axis - 1)

    def window(self, row: int, rows: int) -> slice | None:
        """The template's rows with its axis on a row of a gauge that has `rows`; None beyond its ends."""
        return slice(row - self.axis, row + self.axis + 1) if self.axis <= row < rows - self.axis else None

    def face_around(self, row: int) -> Floats:
        """(H, C): the face in the window around a row."""
        return self._face[row - self.axis : row + self.axis + 1]

    def again(self, gauge: Floats, match: Match, below: NeedleTemplate, below_row: float) -> Settled | None:
        """A match settled anew over a face on which another needle, the one below, lies with its axis on a row.

        None where no needle fits over that one.
        """
        row, settled = round(match.row), None
        for _ in range(MAX_STEPS):
            if not self.axis <= row < len(gauge) - self.axis:
                break
            rows = slice(row - self.axis, row + self.axis + 1)
            behind = partial(_with_lower, self._face[rows], below, below_row - rows.start)
            fit = self.fitter.fit(gauge[rows], behind)
            if not abs(fit.fraction) <= self.axis:
                break
            settled = Settled(Match(row + fit.fraction, fit.sigma_rows, fit.score), row, fit)
            if abs(fit.fraction) <= MAX_FRACTION_ROWS:
                break
            row += round(fit.fraction)
        return settled

    @cached_property
    def _coarse(self) -> NeedleTemplate:
        return thinned(self.template)

    def _whole(self, rows: slice) -> FaceMoments:
        """The moments of needle and whole face for some of the gauge's rows, every third of them."""
        phase = rows.start % COARSE_STEP
        if phase not in self._moments:
            face = np.ascontiguousarray(self._face[phase::COARSE_STEP, ::COARSE_STEP])
            self._moments[phase] = face_moments(face, self._coarse)
        first = rows.start // COARSE_STEP
        count = len(range(rows.start, rows.stop, COARSE_STEP)) - self._coarse.rows + 1
        return self._moments[phase].part(slice(first, first + count))

    def _padded(self, inner: Floats, rows: int) -> Floats:
        scores = np.zeros(rows, np.float32)
        scores[self.axis : self.axis + len(inner)] = inner
        return scores


def _bare(face: Floats, _: Floats) -> Floats:
    return face


def _with_lower(face: Floats, below: NeedleTemplate, below_row: float, transparency: Floats) -> Floats:
    light, part = LowerNeedle(below, len(transparency)).at(np.array([below_row])).behind(transparency)
    behind: Floats = light[0] + part[0] * face
    return behind
