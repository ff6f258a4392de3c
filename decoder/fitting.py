"""Fitting: least squares of a needle over its face in one window, for gain, offset and shift.

Its solution is the NCC's maximum between rows. The fit is linear in the shift, so it is made twice: once with the
needle on the window's middle row, once with the needle moved to the half row nearest to what the first found.
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

PHASES_PER_ROW = 2
MAX_FRACTION_ROWS = 0.75
# A needle with less than a twentieth of the template's contrast is none.
MIN_GAIN = 0.05
MIDDLE_GREY = 128.0
TINY = 1e-9

# Rows of the moment matrix: the needle over the face, 1, how that changes down the rows, the gauge, and the face alone.
NEEDLE, ONE, SLOPE, SEEN, FACE = range(5)
Moments = list[list[float]]

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
    """

    fraction: float
    sigma_rows: float
    noise: float
    correlation: float
    gain: float
    _rows: Floats
    _solution: tuple[float, float, float]
    _shape: tuple[int, ...]
    _moments: Moments

    @property
    def score(self) -> float:
        """The correlation with what the face explains taken out, as in `over_face`: in [-1, 1]."""
        return _partial_correlation(self._moments)

    @property
    def unexplained(self) -> Floats:
        """(H, C) float32: what stays of each pixel."""
        left: Floats = self._rows[3] - np.array(self._solution, np.float32) @ self._rows[:3]
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

    def first(self, window: Floats, behind: Behind) -> Fit:
        """One step of least squares from the window's middle row: good to a tenth of a row when it is less than one."""
        return self._step(window, self._phases[0], behind, None)

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
        rows = np.empty((5, window.size), np.float32)
        shaped = rows.reshape(5, *window.shape)
        np.multiply(template.transparency, face, out=shaped[0])
        shaped[0] += template.light
        shaped[1] = 1.0
        np.multiply(phase.transparency_slope, face, out=shaped[2])
        shaped[2] += phase.light_slope
        np.subtract(window, MIDDLE_GREY, out=shaped[3])  # keeps the sums of squares small enough for float32
        shaped[4] = face
        weights = template.trust if mask is None else template.trust * mask
        moments = (rows * weights.ravel()) @ rows.T
        return self._solved(phase, rows, moments.tolist(), window.shape)

    def _solved(self, phase: _Phase, rows: Floats, moments: Moments, shape: tuple[int, ...]) -> Fit:
        total = moments[ONE][ONE]
        solution, shift_variance = _solution(moments)
        gain, _, shift = solution
        if gain < MIN_GAIN or total <= 0:
            return _no_fit(shape)
        right = [moments[row][SEEN] for row in (NEEDLE, ONE, SLOPE)]
        variance = (moments[SEEN][SEEN] - right[ONE] ** 2 / total) / total
        explained = sum(part * share for part, share in zip(solution, right, strict=True))
        noise = max((moments[SEEN][SEEN] - explained) / total, 0.0)
        return Fit(
            fraction=phase.shift_rows + shift / gain,
            sigma_rows=math.sqrt(noise * max(shift_variance, 0.0) / self._pixels_per_sample) / gain,
            noise=noise,
            correlation=math.sqrt(max(1.0 - noise / variance, 0.0)) if variance > 0 else 0.0,
            gain=gain,
            _rows=rows,
            _solution=solution,
            _shape=shape,
            _moments=moments,
        )


def _solution(moments: Moments) -> tuple[tuple[float, float, float], float]:
    """Gain, offset and shift by Cramer's rule, and the shift's variance for unit noise; a gain of 0 if there is none.

    Three unknowns and plain numbers: a general solver's call costs more than the arithmetic.
    """
    (a, b, c, x), (_, d, e, y), (_, _, f, z) = (moments[row][:4] for row in (NEEDLE, ONE, SLOPE))
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    if determinant <= TINY * a * d * f:
        return (0.0, 0.0, 0.0), math.inf
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    gain = (aa * x + bb * y + cc * z) / determinant
    offset = (bb * x + dd * y + ee * z) / determinant
    shift = (cc * x + ee * y + ff * z) / determinant
    return (gain, offset, shift), ff / determinant


def _partial_correlation(moments: Moments) -> float:
    """Of needle and gauge, given the face."""
    total = max(moments[ONE][ONE], 1e-9)

    def shared(first: int, second: int) -> float:
        return moments[first][second] - moments[first][ONE] * moments[second][ONE] / total

    of_face = shared(FACE, FACE) + total * FACE_NOISE_LEVELS**2
    needle_face, seen_face = shared(NEEDLE, FACE), shared(SEEN, FACE)
    needle_left = shared(NEEDLE, NEEDLE) - needle_face**2 / of_face
    seen_left = shared(SEEN, SEEN) - seen_face**2 / of_face
    if min(needle_left, seen_left) <= total * MIN_SPREAD_LEVELS**2:
        return 0.0
    both = shared(NEEDLE, SEEN) - needle_face * seen_face / of_face
    return min(max(both / math.sqrt(needle_left * seen_left), -1.0), 1.0)


def _phase(template: NeedleTemplate, shift_rows: float) -> _Phase:
    rows = np.arange(template.rows) - shift_rows
    light, transparency = rows_at(template.light, rows), rows_at(template.transparency, rows)
    moved = replace(template, light=light.astype(np.float32), transparency=transparency.astype(np.float32))
    return _Phase(shift_rows, moved, -np.gradient(moved.light, axis=0), -np.gradient(moved.transparency, axis=0))


def _no_fit(shape: tuple[int, ...]) -> Fit:
    nothing = np.zeros((5, math.prod(shape)), np.float32)
    return Fit(math.nan, math.inf, math.inf, 0.0, 0.0, nothing, (0.0, 0.0, 0.0), shape, [[0.0] * 5] * 5)
