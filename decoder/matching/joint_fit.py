"""Two needles of one gauge, one over the other, fitted together by least squares: both places, gain and offset.

What shows of each depends on where the other is, so both are moved at once, in several steps from a first guess.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from decoder.matching.lower_layer import LowerNeedle
from decoder.matching.needle_fit import (
    FACE,
    MIDDLE_GREY,
    NEEDLE,
    ONE,
    PHASE_REACH,
    PHASES_PER_ROW,
    SEEN,
    SLOPE,
    partial_correlation,
    phases_of,
    summed_products,
)
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import Strips
from decoder.matching.thresholds import MAX_FRACTION_ROWS, MAX_PEAK_ROWS, MIN_CONTRAST_PART, SETTLED_ROWS
from decoder.panel.arrays import Floats, Indices, Mask, limited

STEPS = 6
# Neighbouring pixels share their errors, since what two needles leave unexplained is from their edges, not noise.
SHARED_NOISE = 3.0
# Offsets of the lower needle: its place, and those to either side for the derivative of its layer.
BESIDE_ROWS = np.array([[0.0], [-0.5], [0.5]])
LOWER, LAYERS = FACE + 1, FACE + 2
# The rows of the moment matrix that are solved for, and the flat indices of their equations in it. The result of `take`
# is laid out frame by frame, so that its sums do not depend on how many frames there are.
UNKNOWNS = np.array([NEEDLE, SLOPE, LOWER, ONE])
NORMAL, RIGHT = UNKNOWNS[:, None] * LAYERS + UNKNOWNS, UNKNOWNS * LAYERS + SEEN
# Regularisation: a lower needle that is hidden tells nothing of its place, and stays.
HELD = 1e-2
HOLD = np.diag([1e-6, 1e-6, 1e-3, 1e-6])


@dataclass(frozen=True, slots=True)
class Joint:
    """M pairs of needles, as fitted; (M,) except for the last three, (M, H * C).

    Attributes
    ----------
    upper_row, lower_row
        NaN where they do not converge.
    upper_sigma_rows, lower_sigma_rows
        Their uncertainties.
    score
        Of the upper needle, given all that lies behind it.
    correlation
        Of the whole window with both needles over the face.
    noise
        The mean square residual, grey levels squared; infinite where nothing fits.
    gain
        The needles' contrast in units of their templates'.
    window
        The row around which the windows lie.
    unexplained
        The residual of each pixel.
    face
        The dial there.
    """

    upper_row: Floats
    lower_row: Floats
    upper_sigma_rows: Floats
    lower_sigma_rows: Floats
    score: Floats
    correlation: Floats
    noise: Floats
    gain: Floats
    window: Indices
    unexplained: Floats
    face: Floats

    def part(self, which: Indices | Mask) -> Joint:
        """Return some of the pairs."""
        return Joint(*(getattr(self, field.name)[which] for field in fields(self)))


@dataclass(frozen=True, slots=True)
class _Places:
    """Where M upper needles are drawn, (M,) each, with gauge and face there, (M, H * C).

    `phase` counts half rows from the row `window` of the windows; `row` is both together.
    """

    window: Indices
    phase: Indices
    row: Floats
    seen: Floats
    face: Floats


class JointFitter:
    """Fits two needles together; `pixels_per_sample` is that of their gauge's grid."""

    def __init__(self, upper: NeedleTemplate, lower: LowerNeedle, pixels_per_sample: float) -> None:
        self._lower, self._shape = lower, upper.pixels.shape
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        phases = phases_of(upper)
        light, transparency = phases.light, phases.transparency
        # By phase: light, transparency, their derivatives by movement, and the transparency held above a minimum.
        held = np.maximum(transparency[:, 0], np.float32(MIN_CONTRAST_PART))
        self._drawn = np.stack([light[:, 0], transparency[:, 0], light[:, 1], transparency[:, 1], held])
        self._trust = upper.trust.ravel()

    def fit(self, strips: Strips, upper_rows: Floats, lower_rows: Floats) -> Joint:
        """Fit pairs from starting rows (M,) each; the strips are parts of their gauges."""
        count, size = len(upper_rows), len(self._trust)
        upper, lower = upper_rows.astype(np.float64), lower_rows.astype(np.float64)
        window, moments = np.empty(count, np.intp), np.empty((count, LAYERS, LAYERS))
        unexplained, face = np.empty((2, count, size), np.float32)
        open_, is_near = np.arange(count), np.zeros(count, bool)
        for steps_left in range(STEPS, -1, -1):  # the last one evaluates the final rows
            at = self._places(strips.part(open_), upper[open_])
            layers = self._layers(at, lower[open_])
            sums = summed_products(layers, self._trust)
            solution, _ = _solved(sums)
            last = is_near[open_] | (not steps_left)
            if last.any():
                done = open_[last]
                upper[done], window[done], moments[done] = at.row[last], at.window[last], sums[last]
                unexplained[done], face[done] = _unexplained(solution[last], layers[last]), at.face[last]
            further = np.flatnonzero(~last)
            if not further.size:
                break
            open_ = open_[further]
            off = _off(solution[further])
            moved = np.where(np.isfinite(off), limited(off, -MAX_PEAK_ROWS / 2, MAX_PEAK_ROWS / 2), 0.0)
            upper[open_] = at.row[further] + moved[:, 0]
            lower[open_] += moved[:, 1]
            is_near[open_] = (np.abs(moved) <= SETTLED_ROWS).all(axis=1)
        return Joint(**self._found(upper, lower, moments), window=window, unexplained=unexplained, face=face)

    def _found(self, upper: Floats, lower: Floats, moments: Floats) -> dict[str, Floats]:
        """Return the results for pairs drawn on these rows (M,), from their sums (M, 6, 6)."""
        solution, inverse = _solved(moments)
        gain, off, noise = solution[:, 0], _off(solution), _noise(moments, solution)
        near = (np.abs(off) <= MAX_FRACTION_ROWS).all(axis=1)
        total = moments[:, ONE, ONE]
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = (moments[:, SEEN, SEEN] - moments[:, SEEN, ONE] ** 2 / total) / total
            sigma = np.sqrt(np.maximum(inverse[:, [1, 2], [1, 2]], 0.0) * noise[:, None] / self._pixels_per_sample)
            sigma *= SHARED_NOISE / gain[:, None]
            correlation = np.sqrt(np.maximum(1.0 - noise / variance, 0.0))
        return {
            "upper_row": np.where(near, upper + off[:, 0], np.nan),
            "lower_row": np.where(near, lower + off[:, 1], np.nan),
            "upper_sigma_rows": sigma[:, 0],
            "lower_sigma_rows": sigma[:, 1],
            "score": np.where(near, partial_correlation(moments.transpose(1, 2, 0)), 0.0),
            "correlation": np.where(near, correlation, 0.0),
            "noise": np.where(near, noise, np.inf),
            "gain": gain,
        }

    def _places(self, strips: Strips, upper: Floats) -> _Places:
        """Return the places on the grid of phases nearest to the upper needles' rows."""
        last = len(strips.face) - self._axis - 1
        window = limited(np.rint(upper), self._axis, last).astype(np.intp)
        phase = limited(np.rint((upper - window) * PHASES_PER_ROW), -PHASE_REACH, PHASE_REACH).astype(np.intp)
        return _Places(window, phase, window + phase / PHASES_PER_ROW, *strips.windows(window, self._axis))

    def _layers(self, at: _Places, lower: Floats) -> Floats:
        """(M, 6, H * C): the layers of the moment matrix, with the lower needles on rows (M,) of the gauge."""
        count = len(lower)
        light, over, more_light, more_over, held = self._drawn.take(at.phase + PHASE_REACH, axis=1)
        face = at.face.reshape(count, *self._shape)
        rows = lower - at.window + self._axis + BESIDE_ROWS
        through, before, after = self._lower.at(rows).through(over, face)
        layers = np.empty((count, LAYERS, *self._shape), np.float32)
        behind = np.divide(through, held, out=layers[:, FACE])
        np.copyto(behind, face, where=over < held)
        np.add(light, through, out=layers[:, NEEDLE])
        slope = np.multiply(more_over, behind, out=layers[:, SLOPE])
        slope += more_light
        np.subtract(after, before, out=layers[:, LOWER])  # over one row
        layers[:, ONE] = 1.0
        flat = layers.reshape(count, LAYERS, -1)
        np.subtract(at.seen, np.float32(MIDDLE_GREY), out=flat[:, SEEN])
        return flat


def _unexplained(solution: Floats, layers: Floats) -> Floats:
    """(M, H * C) float32: the residuals."""
    parts = np.zeros((len(layers), 1, LAYERS), np.float32)
    parts[:, 0, UNKNOWNS] = -solution
    parts[:, 0, SEEN] = 1.0
    left: Floats = (parts @ layers)[:, 0]
    return left


def _off(solution: Floats) -> Floats:
    """(M, 2): how far the upper and the lower needle lie from where they were drawn; NaN where none fits."""
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = solution[:, 0]
        off: Floats = solution[:, 1:3] / np.where(gain >= MIN_CONTRAST_PART, gain, np.nan)[:, None]
    return off


def _solved(moments: Floats) -> tuple[Floats, Floats]:
    """Return the solution by `UNKNOWNS`, (M, 4), and the inverse normal matrix, (M, 4, 4)."""
    normal, right = _equations(moments)
    held = normal + HOLD
    held[:, 2, 2] += HELD * moments[:, SLOPE, SLOPE]
    inverse = np.linalg.inv(held)
    return (inverse @ right[..., None])[..., 0], inverse


def _noise(moments: Floats, solution: Floats) -> Floats:
    """(M,): the mean square residual."""
    normal, right = _equations(moments)
    left = moments[:, SEEN, SEEN] + (((normal @ solution[..., None])[..., 0] - 2 * right) * solution).sum(axis=1)
    noise: Floats = np.maximum(left, 0.0) / np.maximum(moments[:, ONE, ONE], 1e-9)
    return noise


def _equations(moments: Floats) -> tuple[Floats, Floats]:
    """Return the normal matrix by `UNKNOWNS`, (M, 4, 4), and the right-hand side, (M, 4)."""
    numbers = moments.reshape(-1, LAYERS * LAYERS)
    return numbers.take(NORMAL, axis=1), numbers.take(RIGHT, axis=1)
