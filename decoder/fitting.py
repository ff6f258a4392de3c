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
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FACE_NOISE_LEVELS
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
    score
        The same with what the face explains taken out, as in `over_face`: in [-1, 1].
    gain
        The needle's contrast in units of the template's.
    """

    fraction: float
    sigma_rows: float
    noise: float
    correlation: float
    score: float
    gain: float
    _rows: Floats
    _solution: Floats
    _shape: tuple[int, ...]

    @property
    def unexplained(self) -> Floats:
        """(H, C) float32: what stays of each pixel."""
        left: Floats = self._rows[3] - self._solution.astype(np.float32) @ self._rows[:3]
        return left.reshape(self._shape)


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
        rows = np.empty((5, window.size), np.float32)  # needle over face, 1, its slope, what is seen, the face alone
        shaped = rows.reshape(5, *window.shape)
        np.multiply(template.transparency, face, out=shaped[0])
        shaped[0] += template.light
        shaped[1] = 1.0
        np.multiply(phase.transparency_slope, face, out=shaped[2])
        shaped[2] += phase.light_slope
        np.subtract(window, window.mean(), out=shaped[3])  # keeps the sums of squares small enough for float32
        shaped[4] = face
        weights = template.trust if mask is None else template.trust * mask
        moments = (rows * weights.ravel()) @ rows.T
        return self._solved(phase, rows, moments.astype(np.float64), window.shape)

    def _solved(self, phase: _Phase, rows: Floats, moments: Floats, shape: tuple[int, ...]) -> Fit:
        normal, right, total = moments[:3, :3], moments[:3, 3], float(moments[1, 1])
        try:
            covariance = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return _no_fit(shape)
        solution = covariance @ right
        gain, _, shift = solution.tolist()
        if gain < MIN_GAIN or total <= 0:
            return _no_fit(shape)
        variance = (float(moments[3, 3]) - float(right[1]) ** 2 / total) / total
        noise = max(float(moments[3, 3] - solution @ right) / total, 0.0)
        spread = math.sqrt(noise * max(float(covariance[2, 2]), 0.0) / self._pixels_per_sample)
        return Fit(
            fraction=phase.shift_rows + shift / gain,
            sigma_rows=spread / gain,
            noise=noise,
            correlation=math.sqrt(max(1.0 - noise / variance, 0.0)) if variance > 0 else 0.0,
            score=_partial_correlation(moments),
            gain=gain,
            _rows=rows,
            _solution=solution,
            _shape=shape,
        )


def _partial_correlation(moments: Floats) -> float:
    """Of needle and gauge, given the face; from the weighted moments of needle over face, 1, slope, gauge and face."""
    needle, one, _, seen, face = range(5)
    total = max(float(moments[one, one]), 1e-9)

    def shared(first: int, second: int) -> float:
        return float(moments[first, second] - moments[first, one] * moments[second, one] / total)

    of_face = shared(face, face) + total * FACE_NOISE_LEVELS**2
    needle_left = shared(needle, needle) - shared(needle, face) ** 2 / of_face
    seen_left = shared(seen, seen) - shared(seen, face) ** 2 / of_face
    if min(needle_left, seen_left) <= total * MIN_SPREAD_LEVELS**2:
        return 0.0
    both = shared(needle, seen) - shared(needle, face) * shared(seen, face) / of_face
    return min(max(both / math.sqrt(needle_left * seen_left), -1.0), 1.0)


def _phase(template: NeedleTemplate, shift_rows: float) -> _Phase:
    rows = np.arange(template.rows) - shift_rows
    light, transparency = rows_at(template.light, rows), rows_at(template.transparency, rows)
    moved = replace(template, light=light.astype(np.float32), transparency=transparency.astype(np.float32))
    return _Phase(shift_rows, moved, -np.gradient(moved.light, axis=0), -np.gradient(moved.transparency, axis=0))


def _no_fit(shape: tuple[int, ...]) -> Fit:
    return Fit(
        math.nan, math.inf, math.inf, 0.0, 0.0, 0.0, np.zeros((5, math.prod(shape)), np.float32), np.zeros(3), shape
    )
