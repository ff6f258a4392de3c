"""Fitting: least squares of a needle over its face in one window, for gain, offset and shift.

Its solution is the NCC's maximum between rows. The fit is linear in the shift, so it is made twice: once with the
needle on the window's middle row, once with the needle moved to the half row nearest to what the first found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, limited
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FACE_NOISE_LEVELS
from decoder.unwrapping import cubic_weights

PHASES_PER_ROW = 2
MAX_FRACTION_ROWS = 0.75
# How many phases to either side a fit may need.
PHASE_REACH = math.ceil(MAX_FRACTION_ROWS * PHASES_PER_ROW)
# A needle with less than a twentieth of the template's contrast is none.
MIN_GAIN = 0.05
MIDDLE_GREY = 128.0
TINY = 1e-9

# Rows of the moment matrix: the needle over the face, how that changes down the rows, 1, the gauge, and the face alone.
NEEDLE, SLOPE, ONE, SEEN, FACE = range(5)
Moments = list[list[float]]

Behind = Callable[[Floats], Floats]
"""Gives what lies behind a needle, (H, C) float32, by its transparency there, moved by a part of a row, (H, C)."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Least squares in one window of H by C pixels.

    Attributes
    ----------
    fraction, sigma_rows
        How many rows below the window's middle the needle lies, and the spread of that; NaN where none fits.
    noise
        The mean square that stays unexplained, grey levels squared.
    gain
        The needle's contrast in units of the template's.
    """

    fraction: float
    sigma_rows: float
    noise: float
    gain: float
    _variance: float
    _offset: float
    _shift: float
    _moments: Moments
    _window: Floats
    _layers: Floats

    @property
    def correlation(self) -> float:
        """Of the window with the needle over the face, the thesis's NCC for this one place."""
        return math.sqrt(max(1.0 - self.noise / self._variance, 0.0)) if self._variance > 0 else 0.0

    @property
    def score(self) -> float:
        """The correlation with what the face explains taken out, as in `over_face`: in [-1, 1]."""
        return _partial_correlation(self._moments)

    @property
    def unexplained(self) -> Floats:
        """(H, C) float32: what stays of each pixel."""
        needle, slope = self._layers
        left: Floats = self._window - (MIDDLE_GREY + self._offset) - self.gain * needle - self._shift * slope
        return left.astype(np.float32)


@dataclass(frozen=True, slots=True)
class Phases:
    """The template moved by every half row that a fit may need, upwards first.

    `light` and `transparency`, (2 * PHASE_REACH + 1, 2, H, C) each, are its layers and how these change when it moves
    on; at PHASE_REACH it is where it was.
    """

    light: Floats
    transparency: Floats


class Fitter:
    """Fits one needle; `pixels_per_sample` is how much of an original pixel one sample of the gauge stands for."""

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float) -> None:
        self._pixels_per_sample = pixels_per_sample
        self._template = template
        self._trust = template.trust.ravel()

    @property
    def _phases(self) -> Phases:
        return phases_of(self._template)

    def first(self, window: Floats, behind: Behind) -> Fit:
        """One step of least squares from the window's middle row: good to a tenth of a row when it is less than one."""
        return self._step(window, 0, behind, self._trust)

    def fit(self, window: Floats, behind: Behind, mask: Floats | None = None, *, guess_rows: float = 0.0) -> Fit:
        """The needle in a window (H, C), expected `guess_rows` below its middle; where `mask` (H, C) is 0 not at all.

        A first step of more than three quarters of a row is returned as it is: the window lies elsewhere.
        """
        weights = self._trust if mask is None else self._trust * mask.ravel()
        guess = round(guess_rows * PHASES_PER_ROW)
        first = self._step(window, guess, behind, weights)
        if not abs(first.fraction) <= MAX_FRACTION_ROWS:
            return first
        nearest = round(first.fraction * PHASES_PER_ROW)
        return first if nearest == guess else self._step(window, nearest, behind, weights)

    def _step(self, window: Floats, phase: int, behind: Behind, weights: Floats) -> Fit:
        light, transparency = (own[PHASE_REACH + phase] for own in (self._phases.light, self._phases.transparency))
        face = behind(transparency[0])
        rows = np.empty((5, *window.shape), np.float32)
        layers = rows[:ONE]
        np.multiply(transparency, face, out=layers)
        layers += light
        rows[ONE] = 1.0
        np.subtract(window, MIDDLE_GREY, out=rows[SEEN])
        rows[FACE] = face
        flat = rows.reshape(5, -1).astype(np.float64)  # what a good fit leaves is a small difference of large sums
        moments = (flat * weights) @ flat.T
        return self._solved(phase, layers, moments.tolist(), window)

    def _solved(self, phase: int, layers: Floats, moments: Moments, window: Floats) -> Fit:
        total = moments[ONE][ONE]
        (gain, offset, shift), shift_variance = _solution(moments)
        if gain < MIN_GAIN or total <= 0:
            return Fit(math.nan, math.inf, math.inf, 0.0, 0.0, 0.0, 0.0, _NO_MOMENTS, window, np.zeros_like(layers))
        seen = moments[SEEN]
        variance = (seen[SEEN] - seen[ONE] ** 2 / total) / total
        noise = max((seen[SEEN] - gain * seen[NEEDLE] - offset * seen[ONE] - shift * seen[SLOPE]) / total, 0.0)
        sigma_rows = math.sqrt(noise * max(shift_variance, 0.0) / self._pixels_per_sample) / gain
        fraction = phase / PHASES_PER_ROW + shift / gain
        return Fit(fraction, sigma_rows, noise, gain, variance, offset, shift, moments, window, layers)


def _solution(moments: Moments) -> tuple[tuple[float, float, float], float]:
    """Gain, offset and shift by Cramer's rule, and the shift's variance for unit noise; a gain of 0 if there is none.

    Three unknowns and plain numbers: a general solver's call costs more than the arithmetic.
    """
    (a, c, b, x, _), (_, f, e, z, _), (_, _, d, y, _), _, _ = moments  # in the order needle, slope, one, seen
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


def phases_of(template: NeedleTemplate) -> Phases:
    """The template moved by every half row that a fit may need."""
    return template.once(_phases)


def _phases(template: NeedleTemplate) -> Phases:
    rows, columns = template.pixels.shape
    margin = PHASE_REACH + 1
    within = limited(np.arange(-margin, rows + margin), 0, rows - 1)
    padded = np.stack([template.light[within], template.transparency[within]])
    # the template, then how it changes, of light and transparency: (2, phases, 2, H, C)
    layers = np.empty((2, 2 * PHASE_REACH + 1, 2, rows, columns), np.float32)
    between: dict[float, Floats] = {}  # by part of a row: phases a whole row apart are rows of the same
    for phase in range(-PHASE_REACH, PHASE_REACH + 1):
        before, part = divmod(-phase / PHASES_PER_ROW, 1.0)
        if part not in between:
            between[part] = _between(padded, part)
        first = margin + int(before) - 1
        layers[:, PHASE_REACH + phase, 0] = between[part][:, first : first + rows]
    own, change = layers[:, :, 0], layers[:, :, 1]
    np.subtract(own[:, :, :-2], own[:, :, 2:], out=change[:, :, 1:-1])
    change[:, :, 1:-1] *= np.float32(0.5)
    change[:, :, 0], change[:, :, -1] = own[:, :, 0] - own[:, :, 1], own[:, :, -2] - own[:, :, -1]
    return Phases(*layers)


def _between(layers: Floats, part: float) -> Floats:
    """(2, R - 3, C): layers (2, R, C) a part of a row below each of their rows but the first and the last two."""
    count = layers.shape[1] - 3
    first, *others = (
        np.float32(weight) * layers[:, tap : tap + count] for tap, weight in enumerate(cubic_weights(part)) if weight
    )
    found: Floats = first
    for other in others:
        found += other
    return found


_NO_MOMENTS: Moments = [[0.0] * 5] * 5
