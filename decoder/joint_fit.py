"""Two needles of one gauge, one over the other, settled together by least squares: both places, gain and offset.

What shows of each depends on where the other is; so from a first guess both are moved at once, a few times over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.fitting import FACE, MIDDLE_GREY, MIN_GAIN, NEEDLE, ONE, PHASES_PER_ROW, SEEN, SLOPE, phases_of
from decoder.lower_layer import LowerLayer
from decoder.needle_template import NeedleTemplate
from decoder.quick_fit import partial_correlation
from decoder.strips import Strips

STEPS = 6
MAX_STEP_ROWS = 1.5
SETTLED_ROWS = 0.2
# A pair that would still move further than this is on its way to another.
NEAR_ROWS = 0.75
# What two needles leave unexplained is their edges' rather than noise: neighbouring pixels share it.
SHARED_NOISE = 3.0
# How the lower needle's layer changes is told by half a row to either side.
HALF_ROWS = 0.5
# A lower needle that is hidden says nothing of its place: it stays.
HELD = 1e-2
LOWER = FACE + 1
LAYERS = SLOPE + 1  # needle and slope come first
# The rows of the moment matrix that are solved for.
UNKNOWNS = [NEEDLE, SLOPE, LOWER, ONE]


@dataclass(frozen=True, slots=True)
class Joint:
    """M pairs of needles where they leave least unexplained; (M,) but for the last three, (M, H * C).

    Attributes
    ----------
    upper_row, lower_row
        NaN where they do not settle.
    upper_sigma_rows, lower_sigma_rows
        Their spreads.
    score
        Of the upper needle, given all that lies behind it.
    correlation
        Of the whole window with both needles over the face.
    noise
        The mean square that stays unexplained, grey levels squared; infinite where nothing fits.
    gain
        The needles' contrast in units of their templates'.
    window
        The row around which the windows lie.
    unexplained
        What stays of each pixel.
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

    def part(self, which: slice) -> Joint:
        """Some of the pairs."""
        return Joint(*(getattr(self, field.name)[which] for field in fields(self)))

    @staticmethod
    def chosen(tries: Sequence[Joint], which: Indices) -> Joint:
        """By frame that of some tries which is asked for, (M,)."""
        every = np.arange(len(which))
        return Joint(*(np.stack([getattr(own, field.name) for own in tries])[which, every] for field in fields(Joint)))


class JointFitter:
    """Settles two needles together; `pixels_per_sample` as of their gauge's grid."""

    def __init__(self, upper: NeedleTemplate, lower: NeedleTemplate, pixels_per_sample: float) -> None:
        self._lower, self._shape = lower, upper.pixels.shape
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        phases = phases_of(upper)
        self._reach = max(phases)
        self._light, self._transparency = (
            np.stack([getattr(phases[step], name) for step in sorted(phases)]) for name in ("light", "transparency")
        )
        self._trust = upper.trust.ravel()

    def fit(self, strips: Strips, upper_rows: Floats, lower_rows: Floats) -> Joint:
        """From where the needles seem to be, (M,) each, on gauges of which the strips are parts."""
        upper, lower = upper_rows.astype(np.float64), lower_rows.astype(np.float64)
        open_ = np.arange(len(upper))
        for _ in range(STEPS):
            part = strips.part(open_)
            window, phase = self._window(part, upper[open_])
            moments = self._moments(self._layers(part, window, phase, lower[open_])[0])
            off = _off(_solved(moments)[0])
            step = np.where(np.isfinite(off), limited(off, -MAX_STEP_ROWS, MAX_STEP_ROWS), 0.0)
            upper[open_] = window + phase / PHASES_PER_ROW + step[:, 0]
            lower[open_] += step[:, 1]
            open_ = open_[(np.abs(step) > SETTLED_ROWS).any(axis=1)]
            if not open_.size:
                break
        window, phase = self._window(strips, upper)
        layers, face = self._layers(strips, window, phase, lower)
        moments = self._moments(layers)
        solution, covariance, noise = _solved(moments)
        gain, off, start = solution[:, 0], _off(solution), window + phase / PHASES_PER_ROW
        near = (np.abs(off) <= NEAR_ROWS).all(axis=1)
        total = moments[:, ONE, ONE]
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = (moments[:, SEEN, SEEN] - moments[:, SEEN, ONE] ** 2 / total) / total
            sigma = np.sqrt(np.maximum(covariance, 0.0) * noise[:, None] / self._pixels_per_sample) / gain[:, None]
            sigma *= SHARED_NOISE
            correlation = np.sqrt(np.maximum(1.0 - noise / variance, 0.0))
        left = layers[:, SEEN] - (solution[:, :, None] * layers[:, UNKNOWNS]).sum(axis=1)
        return Joint(
            upper_row=np.where(near, start + off[:, 0], np.nan),
            lower_row=np.where(near, lower + off[:, 1], np.nan),
            upper_sigma_rows=sigma[:, 1],
            lower_sigma_rows=sigma[:, 2],
            score=np.where(near, partial_correlation(moments.transpose(1, 2, 0)), 0.0),
            correlation=np.where(near, correlation, 0.0),
            noise=np.where(near, noise, np.inf),
            gain=gain,
            window=window,
            unexplained=left.astype(np.float32),
            face=face,
        )

    def _window(self, strips: Strips, upper: Floats) -> tuple[Indices, Indices]:
        """The whole rows around which windows lie, and the phases at which the upper needles then are."""
        last = len(strips.face) - self._axis - 1
        window = limited(np.rint(upper), self._axis, last).astype(np.intp)
        phase = limited(np.rint((upper - window) * PHASES_PER_ROW), -self._reach, self._reach).astype(np.intp)
        return window, phase

    def _moments(self, layers: Floats) -> Floats:
        moments: Floats = ((layers * self._trust) @ layers.transpose(0, 2, 1)).astype(np.float64)
        return moments

    def _layers(self, strips: Strips, window: Indices, phase: Indices, lower: Floats) -> tuple[Floats, Floats]:
        """(M, 6, H * C): what the sums are made of; and the face there, (M, H * C)."""
        count = len(window)
        seen, face = strips.windows(window, self._axis)
        light, transparency = (each[phase + self._reach] for each in (self._light, self._transparency))
        places: Floats = np.stack([lower, lower - HALF_ROWS, lower + HALF_ROWS]) - (window - self._axis)
        back_light, backs = LowerLayer.at(self._lower, self._shape[0], places).behind(transparency[:, 0])
        backs *= face.reshape(count, *self._shape)
        backs += back_light
        back, before, after = backs
        layers = np.empty((count, 6, seen.shape[1]), np.float32)
        drawn = layers.reshape(count, 6, *self._shape)
        np.multiply(transparency, back[:, None], out=drawn[:, :LAYERS])
        drawn[:, :LAYERS] += light
        after -= before  # over one row
        np.multiply(transparency[:, 0], after, out=drawn[:, LOWER])
        layers[:, ONE] = 1.0
        np.subtract(seen, np.float32(MIDDLE_GREY), out=layers[:, SEEN])
        drawn[:, FACE] = back
        return layers, face


def _off(solution: Floats) -> Floats:
    """(M, 2): how far the upper and the lower needle lie from where they were thought to be; NaN where none fits."""
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = solution[:, 0]
        off: Floats = solution[:, 1:3] / np.where(gain >= MIN_GAIN, gain, np.nan)[:, None]
    return off


def _solved(moments: Floats) -> tuple[Floats, Floats, Floats]:
    """Solution (M, 4) by `UNKNOWNS`, the diagonal of the inverse normal matrix (M, 4), and the noise (M,)."""
    normal = moments[:, UNKNOWNS][:, :, UNKNOWNS]
    right = moments[:, UNKNOWNS, SEEN]
    held = normal.copy()
    held[:, 2, 2] += HELD * normal[:, 1, 1] + 1e-3
    held[:, [0, 1, 3], [0, 1, 3]] += 1e-6
    inverse = np.linalg.inv(held)
    solution = (inverse @ right[..., None])[..., 0]
    left = moments[:, SEEN, SEEN] - 2 * (solution * right).sum(axis=1)
    left += np.einsum("mi,mij,mj->m", solution, normal, solution)
    noise = np.maximum(left, 0.0) / np.maximum(moments[:, ONE, ONE], 1e-9)
    return solution, np.einsum("mii->mi", inverse), noise
