"""Matching: where a needle's template fits an unwrapped gauge best, to a fraction of a row, and how surely.

The best row comes from the correlation; least squares on the pixels there gives the fraction (the maximum of the NCC
between rows), and what it leaves unexplained gives the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.correlation import parabola_peak, xcorr
from decoder.fitting import MAX_FRACTION_ROWS, Fit, Fitter
from decoder.needle_layer import face_with_lower
from decoder.needle_template import TOUCH_LEVEL, NeedleTemplate
from decoder.occlusion import Visibility, uncovered_scores
from decoder.over_face import face_moments, partial_normxcorr

# The best row of a blurred needle may be one beside its true place.
MAX_PEAK_ROWS = 1.5
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
        self._moments = face_moments(face, template)
        self.axis = (template.rows - 1) // 2
        self.fitter = Fitter(template, pixels_per_sample)
        self.pixels_per_sample = pixels_per_sample
        self.touched = template.place(TOUCH_LEVEL)
        self.half_width_rows = template.half_width_deg / template.step_deg

    @property
    def independent_pixels(self) -> float:
        """How many original pixels the template's trusted samples are worth."""
        return float(self.template.trust.sum()) * self.pixels_per_sample

    def scores(self, gauge: Floats) -> Floats:
        """NCC of needle and gauge, what the face explains taken out, by the row of the needle's axis: (R,) float32.

        Rows too near an end of the gauge (R, C) score 0.
        """
        return self._padded(partial_normxcorr(gauge, self._face, self.template, self._moments), gauge.shape[0])

    def uncovered(self, gauge: Floats, mask: Floats, scores: Floats, cover_row: float, cover_axis: int) -> Visibility:
        """Scores of the pixels that `mask` (R, C) leaves, and how much of the needle they show; both (R,).

        Away from the covering needle, whose axis lies on `cover_row` in a template that reaches `cover_axis` rows to
        either side, these are the `scores` (R,) of all pixels.
        """
        left = Visibility(scores.copy(), np.ones_like(scores))
        left.visible[: self.axis] = left.visible[len(gauge) - self.axis :] = 0.0
        reach = cover_axis + self.axis + 1
        first, last = max(round(cover_row) - reach, self.axis), min(round(cover_row) + reach, len(gauge) - self.axis)
        if first < last:
            rows = slice(first - self.axis, last + self.axis)
            inner = slice(first, last)
            near = uncovered_scores(gauge[rows], self._face[rows], mask[rows], self.template)
            left.scores[inner], left.visible[inner] = near.scores, near.visible
        return left

    def products(self, gauge: Floats) -> Floats:
        """Plain cross-correlation with the template's axis on each row of (R, C): (R,) float32."""
        return self._padded(xcorr(gauge, self.template.pixels), gauge.shape[0])

    def best(self, gauge: Floats, curve: Floats, allowed: Mask, scores: Floats, mask: Floats | None = None) -> Match:
        """The match at the highest peak of `curve` on an allowed row, its score taken from `scores`; all (R,).

        A highest row whose neighbour is higher but not allowed is no peak: what is there lies elsewhere. Where `mask`,
        (R, C), is 0 the gauge's pixels are left out of the least squares.
        """
        peaks = allowed.copy()
        peaks[1:] &= curve[1:] >= curve[:-1]
        peaks[:-1] &= curve[:-1] >= curve[1:]
        peaks[: self.axis] = peaks[len(curve) - self.axis :] = False
        if not peaks.any():
            return NO_MATCH
        row = int(np.where(peaks, curve, -np.inf).argmax())
        rows = slice(row - self.axis, row + self.axis + 1)
        face = self._face[rows]
        fit = self.fitter.fit(gauge[rows], lambda _: face, None if mask is None else mask[rows])
        if not abs(fit.fraction) <= MAX_PEAK_ROWS:
            return Match(parabola_peak(curve, row), fit.sigma_rows, float(scores[row]))
        return Match(row + fit.fraction, fit.sigma_rows, float(scores[row]))

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
            settled = Settled(Match(row + fit.fraction, fit.sigma_rows, match.score), row, fit)
            if abs(fit.fraction) <= MAX_FRACTION_ROWS:
                break
            row += round(fit.fraction)
        return settled

    def _padded(self, inner: Floats, rows: int) -> Floats:
        scores = np.zeros(rows, np.float32)
        scores[self.axis : self.axis + len(inner)] = inner
        return scores


def _with_lower(face: Floats, below: NeedleTemplate, below_row: float, upper: NeedleTemplate) -> Floats:
    return face_with_lower(face, upper, below, below_row)
