"""Matching: where a needle's template fits an unwrapped gauge best, to a fraction of a row, and how surely.

The best row comes from the correlation; least squares on the pixels there gives the fraction (the maximum of the NCC
between rows), and what it leaves unexplained gives the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.correlation import normxcorr, parabola_peak, xcorr
from decoder.faces import with_needle
from decoder.needle_template import TOUCH_LEVEL, NeedleTemplate
from decoder.occlusion import Visibility, uncovered_scores
from decoder.over_face import face_moments, partial_normxcorr

Floats = NDArray[np.float32]

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
    """Least squares in one window: rows below its middle, the spread of that, and the mean square left unexplained."""

    fraction: float
    sigma_rows: float
    noise: float


NO_FIT = Fit(float("nan"), float("inf"), float("inf"))


@dataclass(frozen=True, slots=True)
class Settled:
    """A match with the mean square that it leaves unexplained, grey levels squared."""

    match: Match
    noise: float


class Matcher:
    """One template, with all that depends on it alone worked out once.

    Parameters
    ----------
    template
        The needle.
    pixels_per_sample
        How much of an original pixel one sample of the unwrapped gauge stands for: neighbouring samples share their noise.
    face
        (R, C) float32: the dial without needles, if it is known.
    """

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float, face: Floats | None) -> None:
        self.template = template
        self._face = face
        self._moments = None if face is None else face_moments(face, template)
        self.axis = (template.rows - 1) // 2
        self._light_slope = -np.gradient(template.light, axis=0)
        self._transparency_slope = -np.gradient(template.transparency, axis=0)
        self._pixels_per_sample = pixels_per_sample
        self.touched = template.place(TOUCH_LEVEL)
        self.half_width_rows = template.half_width_deg / template.step_deg

    @property
    def independent_pixels(self) -> float:
        """How many original pixels the template's trusted samples are worth."""
        return float(self.template.trust.sum()) * self._pixels_per_sample

    def scores(self, gauge: Floats) -> Floats:
        """NCC of the template with its axis on each row of (R, C); rows too near an end score 0: (R,) float32.

        Over a known face, with what the face explains taken out.
        """
        if self._face is None or self._moments is None:
            return self._padded(normxcorr(gauge, self.template.pixels, self.template.weights), gauge.shape[0])
        return self._padded(partial_normxcorr(gauge, self._face, self.template, self._moments), gauge.shape[0])

    def uncovered(self, gauge: Floats, mask: Floats) -> Visibility:
        """Scores of the pixels that `mask` (R, C) leaves, and how much of the needle they show; both (R,) by the axis's row."""
        face = np.zeros_like(gauge) if self._face is None else self._face
        whole = self._moments or face_moments(face, self.template)
        seen = uncovered_scores(gauge, face, mask, self.template, whole)
        return Visibility(self._padded(seen.scores, len(gauge)), self._padded(seen.visible, len(gauge)))

    def products(self, gauge: Floats) -> Floats:
        """Plain cross-correlation with the template's axis on each row of (R, C): (R,) float32."""
        return self._padded(xcorr(gauge, self.template.pixels), gauge.shape[0])

    def best(self, gauge: Floats, curve: Floats, scores: Floats, mask: Floats | None = None) -> Match:
        """The match at the maximum of `curve`, its score taken from `scores`; both (R,).

        Where `mask`, (R, C), is 0 the gauge's pixels are left out of the least squares.
        """
        row = int(curve.argmax())
        if not self.axis <= row < gauge.shape[0] - self.axis or not np.isfinite(curve[row]):
            return NO_MATCH
        rows = slice(row - self.axis, row + self.axis + 1)
        face, seen = (None if image is None else image[rows] for image in (self._face, mask))
        fit = self.fraction(gauge[rows], face, seen)
        if not abs(fit.fraction) <= MAX_FRACTION_ROWS:
            return Match(parabola_peak(curve, row), fit.sigma_rows, float(scores[row]))
        return Match(row + fit.fraction, fit.sigma_rows, float(scores[row]))

    def again(self, gauge: Floats, match: Match, below: NeedleTemplate, below_row: float) -> Settled:
        """A match settled anew over a face on which another needle, the one below, lies with its axis on a row."""
        face = with_needle(np.zeros_like(gauge) if self._face is None else self._face, below, below_row)
        row, settled = round(match.row), Settled(match, float("inf"))
        for _ in range(MAX_STEPS):
            rows = slice(row - self.axis, row + self.axis + 1)
            if not self.axis <= row < len(gauge) - self.axis:
                break
            fit = self.fraction(gauge[rows], face[rows])
            if not abs(fit.fraction) <= self.axis:
                break
            settled = Settled(Match(row + fit.fraction, fit.sigma_rows, match.score), fit.noise)
            if abs(fit.fraction) <= MAX_FRACTION_ROWS:
                break
            row += round(fit.fraction)
        return settled

    def fraction(self, window: Floats, face: Floats | None, mask: Floats | None = None) -> Fit:
        """How far below the middle the needle in a window (H, C) lies.

        One step of least squares for gain, offset and shift of the needle over the face behind it.
        """
        template = self.template
        model, slope = template.light, self._light_slope
        if face is not None:
            model = model + template.transparency * face
            slope = slope + self._transparency_slope * face
        weights = (template.trust if mask is None else template.trust * mask).ravel()
        columns = np.stack([model.ravel(), np.ones(model.size, np.float32), slope.ravel()])
        weighted = columns * weights
        observed = window.ravel()
        try:
            covariance = np.linalg.inv((weighted @ columns.T).astype(np.float64))
        except np.linalg.LinAlgError:
            return NO_FIT
        gain, light, shift = covariance @ (weighted @ observed)
        if gain < MIN_GAIN:
            return NO_FIT
        unexplained = observed - np.array([gain, light, shift], np.float32) @ columns
        noise = float(weights @ (unexplained * unexplained)) / max(float(weights.sum()), 1.0)
        sigma_rows = np.sqrt(noise * max(covariance[2, 2], 0.0) / self._pixels_per_sample) / gain
        return Fit(float(shift / gain), float(sigma_rows), noise)

    def _padded(self, inner: Floats, rows: int) -> Floats:
        scores = np.zeros(rows, np.float32)
        scores[self.axis : self.axis + len(inner)] = inner
        return scores
