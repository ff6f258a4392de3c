"""Matching: where a needle's template fits an unwrapped gauge best, to a fraction of a row, and how surely.

The best row comes from the correlation; least squares on the pixels there gives the fraction (the maximum of the NCC
between rows), and what it leaves unexplained gives the uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.correlation import parabola_peak, xcorr
from decoder.needle_layer import face_with_lower
from decoder.needle_template import TOUCH_LEVEL, NeedleTemplate
from decoder.occlusion import Visibility, uncovered_scores
from decoder.over_face import face_moments, partial_normxcorr

MAX_FRACTION_ROWS = 1.0
MAX_STEPS = 4


@dataclass(frozen=True, slots=True)
class Match:
    """A template's place on an unwrapped gauge: the row of its axis, the spread of that, and the NCC there."""

    row: float
    sigma_rows: float
    score: float


# A needle with less than a twentieth of the template's contrast is none.
MIN_GAIN = 0.05

NO_MATCH = Match(0.0, float("inf"), 0.0)


@dataclass(frozen=True, slots=True)
class Fit:
    """Least squares in one window.

    Attributes
    ----------
    fraction, sigma_rows
        How many rows below the window's middle the needle lies, and the spread of that; NaN where none fits.
    noise
        The mean square that stays unexplained, grey levels squared.
    correlation
        Of the window with the needle over the face, the thesis's NCC for this one place.
    gain
        The needle's contrast in units of the template's.
    unexplained
        (N,) float32: what stays of each pixel.
    """

    fraction: float
    sigma_rows: float
    noise: float
    correlation: float
    gain: float
    unexplained: Floats


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
        self._light_slope = -np.gradient(template.light, axis=0)
        self._transparency_slope = -np.gradient(template.transparency, axis=0)
        self.pixels_per_sample = pixels_per_sample
        self.touched = template.place(TOUCH_LEVEL)
        self.half_width_rows = template.half_width_deg / template.step_deg

    @property
    def independent_pixels(self) -> float:
        """How many original pixels the template's trusted samples are worth."""
        return float(self.template.trust.sum()) * self.pixels_per_sample

    def scores(self, gauge: Floats) -> Floats:
        """NCC of needle and gauge, what the face explains taken out, with the template's axis on each row: (R,) float32.

        Rows too near an end of the gauge (R, C) score 0.
        """
        return self._padded(partial_normxcorr(gauge, self._face, self.template, self._moments), gauge.shape[0])

    def uncovered(self, gauge: Floats, mask: Floats) -> Visibility:
        """Scores of the pixels that `mask` (R, C) leaves, and how much of the needle they show; both (R,)."""
        seen = uncovered_scores(gauge, self._face, mask, self.template, self._moments)
        return Visibility(self._padded(seen.scores, len(gauge)), self._padded(seen.visible, len(gauge)))

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
        fit = self.fraction(gauge[rows], self._face[rows], None if mask is None else mask[rows])
        if not abs(fit.fraction) <= MAX_FRACTION_ROWS:
            return Match(parabola_peak(curve, row), fit.sigma_rows, float(scores[row]))
        return Match(row + fit.fraction, fit.sigma_rows, float(scores[row]))

    def face_around(self, row: int) -> Floats:
        """(H, C): the face in the window around a row."""
        return self._face[row - self.axis : row + self.axis + 1]

    def again(self, gauge: Floats, match: Match, below: NeedleTemplate, below_row: float) -> Settled:
        """A match settled anew over a face on which another needle, the one below, lies with its axis on a row."""
        row = round(match.row)
        settled = Settled(match, row, _no_fit())
        for _ in range(MAX_STEPS):
            rows = slice(row - self.axis, row + self.axis + 1)
            if not self.axis <= row < len(gauge) - self.axis:
                break
            behind = face_with_lower(self._face[rows], self.template, below, below_row - rows.start)
            fit = self.fraction(gauge[rows], behind)
            if not abs(fit.fraction) <= self.axis:
                break
            settled = Settled(Match(row + fit.fraction, fit.sigma_rows, match.score), row, fit)
            if abs(fit.fraction) <= MAX_FRACTION_ROWS:
                break
            row += round(fit.fraction)
        return settled

    def fraction(self, window: Floats, face: Floats, mask: Floats | None = None) -> Fit:
        """How far below the middle the needle in a window (H, C) lies.

        One step of least squares for gain, offset and shift of the needle over the face behind it.
        """
        template = self.template
        model = template.light + template.transparency * face
        slope = self._light_slope + self._transparency_slope * face
        weights = (template.trust if mask is None else template.trust * mask).ravel()
        columns = np.stack([model.ravel(), np.ones(model.size, np.float32), slope.ravel()])
        weighted = columns * weights
        observed = window.ravel()
        try:
            covariance = np.linalg.inv((weighted @ columns.T).astype(np.float64))
        except np.linalg.LinAlgError:
            return _no_fit()
        gain, light, shift = covariance @ (weighted @ observed)
        if gain < MIN_GAIN:
            return _no_fit()
        unexplained = observed - np.array([gain, light, shift], np.float32) @ columns
        noise = float(weights @ (unexplained * unexplained)) / max(float(weights.sum()), 1.0)
        mean = float(weights @ observed) / max(float(weights.sum()), 1.0)
        variance = float(weights @ (observed - mean) ** 2) / max(float(weights.sum()), 1.0)
        correlation = math.sqrt(max(1.0 - noise / variance, 0.0)) if variance > 0 else 0.0
        sigma_rows = np.sqrt(noise * max(covariance[2, 2], 0.0) / self.pixels_per_sample) / gain
        return Fit(float(shift / gain), float(sigma_rows), noise, correlation, float(gain), unexplained)

    def _padded(self, inner: Floats, rows: int) -> Floats:
        scores = np.zeros(rows, np.float32)
        scores[self.axis : self.axis + len(inner)] = inner
        return scores


def _no_fit() -> Fit:
    return Fit(float("nan"), float("inf"), float("inf"), 0.0, 0.0, np.empty(0, np.float32))
