"""Fitting: least squares of a needle over its face in one window, for gain, offset and shift.

Its solution is the NCC's maximum between rows. The fit is linear in the shift, so it is made twice: once with the
needle on the window's middle row, once with the needle moved to the quarter of a row that the first found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from decoder.arrays import Floats
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import rows_at

PHASES_PER_ROW = 4
MAX_FRACTION_ROWS = 0.75
# A needle with less than a twentieth of the template's contrast is none.
MIN_GAIN = 0.05

Behind = Callable[[NeedleTemplate], Floats]
"""Gives what lies behind a needle, (H, C) float32, for the needle moved by a part of a row."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Least squares in one window of H by C pixels.

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
        (H, C) float32: what stays of each pixel.
    """

    fraction: float
    sigma_rows: float
    noise: float
    correlation: float
    gain: float
    unexplained: Floats


@dataclass(frozen=True, slots=True)
class _Phase:
    """The template moved down by a part of a row, and how its layers change when it moves on."""

    shift_rows: float
    template: NeedleTemplate
    light_slope: Floats
    transparency_slope: Floats


class Fitter:
    """Fits one needle; `pixels_per_sample` is how much of an original pixel one sample of the gauge stands for."""

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float) -> None:
        self._pixels_per_sample = pixels_per_sample
        reach = math.ceil(MAX_FRACTION_ROWS * PHASES_PER_ROW)
        self._phases = {step: _phase(template, step / PHASES_PER_ROW) for step in range(-reach, reach + 1)}

    def fit(self, window: Floats, behind: Behind, mask: Floats | None = None) -> Fit:
        """The needle in a window (H, C); where `mask` (H, C) is 0 pixels are left out.

        A first step of more than three quarters of a row is returned as it is: the window lies elsewhere.
        """
        first = self._step(window, self._phases[0], behind, mask)
        if not abs(first.fraction) <= MAX_FRACTION_ROWS:
            return first
        phase = self._phases[round(first.fraction * PHASES_PER_ROW)]
        return first if phase.shift_rows == 0 else self._step(window, phase, behind, mask)

    def _step(self, window: Floats, phase: _Phase, behind: Behind, mask: Floats | None) -> Fit:
        template = phase.template
        face = behind(template)
        model = template.light + template.transparency * face
        slope = phase.light_slope + phase.transparency_slope * face
        weights = (template.trust if mask is None else template.trust * mask).ravel()
        total = max(float(weights.sum()), 1.0)
        columns = np.stack([model.ravel(), np.ones(model.size, np.float32), slope.ravel()])
        weighted, observed = columns * weights, window.ravel()
        try:
            covariance = np.linalg.inv((weighted @ columns.T).astype(np.float64))
        except np.linalg.LinAlgError:
            return _no_fit(window)
        solution = covariance @ (weighted @ observed)
        gain, _, shift = (float(value) for value in solution)
        if gain < MIN_GAIN:
            return _no_fit(window)
        unexplained = observed - solution.astype(np.float32) @ columns
        noise = float(weights @ (unexplained * unexplained)) / total
        variance = float(weights @ (observed - float(weights @ observed) / total) ** 2) / total
        return Fit(
            fraction=phase.shift_rows + shift / gain,
            sigma_rows=math.sqrt(noise * max(float(covariance[2, 2]), 0.0) / self._pixels_per_sample) / gain,
            noise=noise,
            correlation=math.sqrt(max(1.0 - noise / variance, 0.0)) if variance > 0 else 0.0,
            gain=gain,
            unexplained=unexplained.reshape(window.shape),
        )


def _phase(template: NeedleTemplate, shift_rows: float) -> _Phase:
    rows = np.arange(template.rows) - shift_rows
    light, transparency = rows_at(template.light, rows), rows_at(template.transparency, rows)
    moved = replace(template, light=light.astype(np.float32), transparency=transparency.astype(np.float32))
    return _Phase(shift_rows, moved, -np.gradient(moved.light, axis=0), -np.gradient(moved.transparency, axis=0))


def _no_fit(window: Floats) -> Fit:
    return Fit(math.nan, math.inf, math.inf, 0.0, 0.0, np.zeros_like(window))
