"""Matching: where a needle's template fits an unwrapped gauge best, to a fraction of a row, and how surely.

The best row comes from the correlation; least squares on the pixels there gives the fraction (the maximum of the NCC
between rows), and what it leaves unexplained gives the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.correlation import normxcorr, parabola_peak, xcorr
from decoder.needle_template import NeedleTemplate

Floats = NDArray[np.float32]

MAX_FRACTION_ROWS = 1.0


@dataclass(frozen=True, slots=True)
class Match:
    """A template's place on an unwrapped gauge: the row of its axis, the spread of that, and the NCC there."""

    row: float
    sigma_rows: float
    score: float


MIN_GAIN = 1e-3

NO_MATCH = Match(0.0, float("inf"), 0.0)


class Matcher:
    """One template, with all that depends on it alone worked out once.

    Parameters
    ----------
    template
        The needle.
    pixels_per_sample
        How much of an original pixel one sample of the unwrapped gauge stands for: neighbouring samples share their
        noise.
    """

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float) -> None:
        self.template = template
        self.axis = (template.rows - 1) // 2
        pixels = template.pixels.astype(np.float64)
        weights = template.weights.astype(np.float64).ravel()
        slope = np.gradient(pixels, axis=0).ravel()
        self._model = np.stack([pixels.ravel(), np.ones(pixels.size), -slope], axis=1)
        self._weights = weights
        self._pixels_per_sample = pixels_per_sample
        self._solver, self._shift_variance = self._solve(weights)

    def scores(self, gauge: Floats) -> Floats:
        """NCC of the template with its axis on each row of (R, C); rows too near an end score 0: (R,) float32."""
        return self._padded(normxcorr(gauge, self.template.pixels, self.template.weights), gauge.shape[0])

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
        weights, solver, shift_variance = self._weights, self._solver, self._shift_variance
        if mask is not None:
            weights = weights * mask[rows].ravel()
            solver, shift_variance = self._solve(weights)
        window = gauge[rows].astype(np.float64).ravel()
        gain, light, shift = solver @ window
        fraction = shift / gain if gain > 0 else 0.0
        if gain <= 0 or abs(fraction) > MAX_FRACTION_ROWS:
            fraction = parabola_peak(curve, row) - row
        unexplained = window - self._model @ (gain, light, shift)
        noise = float((weights * unexplained * unexplained).sum()) / max(float(weights.sum()), 1.0)
        sigma_rows = float(np.sqrt(noise * shift_variance)) / max(gain, MIN_GAIN)
        return Match(row + float(fraction), sigma_rows, float(scores[row]))

    def _solve(self, weights: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """The least-squares solver for these weights, (3, N), and the shift's variance for unit noise in a pixel."""
        weighted = self._model * weights[:, None]
        covariance = np.linalg.pinv(self._model.T @ weighted)
        return covariance @ weighted.T, float(covariance[2, 2]) / self._pixels_per_sample

    def _padded(self, inner: Floats, rows: int) -> Floats:
        scores = np.zeros(rows, np.float32)
        scores[self.axis : self.axis + len(inner)] = inner
        return scores
