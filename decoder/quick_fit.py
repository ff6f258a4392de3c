"""Fits of one needle in many windows at once: the same least squares as `fitting`, in arrays.

Each window is summed up by a product of its own, always of one shape, and all else is number by number: so a fit does
not depend on those beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.fitting import (
    FACE,
    MAX_FRACTION_ROWS,
    MIDDLE_GREY,
    MIN_GAIN,
    NEEDLE,
    ONE,
    PHASE_REACH,
    PHASES_PER_ROW,
    SEEN,
    SLOPE,
    TINY,
    phases_of,
)
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FACE_NOISE_LEVELS

# What the partial correlation takes of the moments: needle, gauge and face by 1, then what any two of them share.
WITH_ONE = (np.array([ONE, SEEN, FACE]), np.array([NEEDLE, ONE, ONE]))
SHARED = (np.array([FACE, FACE, FACE, NEEDLE, SEEN, SEEN]), np.array([FACE, NEEDLE, SEEN, NEEDLE, SEEN, NEEDLE]))
SHARED_ONE, SHARED_OTHER = np.array([2, 2, 2, 0, 1, 1]), np.array([2, 0, 1, 0, 1, 0])

Behind = Callable[[Indices | slice, Floats], Floats]
"""Gives what lies behind the needle in some of the windows, (M', H * C), with this transparency there."""


@dataclass(frozen=True, slots=True)
class Fits:
    """M fits; all arrays (M,), float64: as in `fitting.Fit`, NaN where no needle fits."""

    fraction: Floats
    sigma_rows: Floats
    score: Floats
    noise: Floats
    gain: Floats
    correlation: Floats
    offset: Floats
    shift: Floats
    phase: Indices

    def replaced(self, chosen: Mask | Indices, others: Fits) -> Fits:
        """These fits with `others`, as many as are chosen, in the chosen ones' places."""
        columns = [getattr(self, field.name).copy() for field in fields(self)]
        for column, field in zip(columns, fields(self), strict=True):
            column[chosen] = getattr(others, field.name)
        return Fits(*columns)


class QuickFitter:
    """Fits one needle, (H, C), in many windows; `pixels_per_sample` as of its gauge's grid."""

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float) -> None:
        self._pixels_per_sample = pixels_per_sample
        phases = phases_of(template)
        # (phases, 2, H * C): light and transparency, and how they change when the needle moves on
        self._light, self._transparency = (
            layers.reshape(*layers.shape[:2], -1) for layers in (phases.light, phases.transparency)
        )
        self._trust = template.trust.ravel()

    def fit(
        self,
        windows: Floats,
        faces: Floats,
        guess_rows: Floats,
        *,
        masks: Floats | None = None,
        behind: Behind | None = None,
    ) -> Fits:
        """The needle in each window, over what lies behind it there.

        Parameters
        ----------
        windows, faces : (M, H * C) float32
        guess_rows : (M,)
            How far below the window's middle the needle is expected, at most half a row.
        masks : (M, H * C) float32
            0 where pixels are left out.
        behind
            What lies behind the needles, if that is not the face alone.
        """
        weights = np.broadcast_to(self._trust, windows.shape) if masks is None else self._trust * masks

        def moments_at(chosen: Indices | slice, phase: Indices) -> Floats:
            transparency = self._transparency[phase + PHASE_REACH]
            back = faces[chosen] if behind is None else behind(chosen, transparency[:, 0])
            return _moments(self._light[phase + PHASE_REACH], transparency, back, windows[chosen], weights[chosen])

        guess = np.rint(guess_rows * PHASES_PER_ROW).astype(np.intp)
        moments = moments_at(slice(None), guess)
        phase = nearest_phases(moments, guess)
        again = np.flatnonzero(phase != guess)
        if again.size:
            moments[..., again] = moments_at(again, phase[again])
        return solved(moments, phase, self._pixels_per_sample)

    def unexplained(self, fits: Fits, windows: Floats, backs: Floats) -> Floats:
        """(M, H * C): what fits leave of each pixel, over what they were made over."""
        phase = fits.phase + PHASE_REACH
        layers = self._transparency[phase] * backs[:, None] + self._light[phase]
        gain, offset, shift = (each.astype(np.float32)[:, None] for each in (fits.gain, fits.offset, fits.shift))
        left: Floats = windows - (np.float32(MIDDLE_GREY) + offset) - gain * layers[:, 0] - shift * layers[:, 1]
        return left


def _moments(light: Floats, transparency: Floats, back: Floats, windows: Floats, weights: Floats) -> Floats:
    """(5, 5, M) float64: as in `fitting`."""
    rows = np.empty((len(windows), 5, windows.shape[1]), np.float32)
    layers = rows[:, :ONE]
    np.multiply(transparency, back[:, None], out=layers)
    layers += light
    rows[:, ONE] = 1.0
    np.subtract(windows, np.float32(MIDDLE_GREY), out=rows[:, SEEN])
    rows[:, FACE] = back
    moments: Floats = summed_products(rows, weights[:, None]).transpose(1, 2, 0)
    return moments


def summed_products(layers: Floats, weights: Floats) -> Floats:
    """(M, K, K) float64: the sums of products of any two of K layers, (M, K, H * C), by the weights of their pixels."""
    weighted = layers * weights
    # as many products of two vectors: on matrices of so few rows a library spends its time on getting started
    sums: Floats = np.vecdot(weighted[:, :, None], layers[:, None]).astype(np.float64)
    return sums


def nearest_phases(moments: Floats, phase: Indices) -> Indices:
    """(M,): the phase nearest to where the least squares find the needle; where that is in another window, the same."""
    with np.errstate(divide="ignore", invalid="ignore"):
        (gain, _, shift), _ = _solution(moments)
        fraction = phase / PHASES_PER_ROW + shift / gain
        near = (gain >= MIN_GAIN) & (moments[ONE, ONE] > 0) & (np.abs(fraction) <= MAX_FRACTION_ROWS)
        return np.where(near, np.rint(fraction * PHASES_PER_ROW), phase).astype(np.intp)


def solved(moments: Floats, phase: Indices, pixels_per_sample: Floats | float) -> Fits:
    """Gain, offset and shift by moments, (5, 5, M) or at least their first four rows and columns.

    Moments are alike either way; these are looked at where the row is not less than the column.
    """
    total, seen = moments[ONE, ONE], moments[SEEN]
    with np.errstate(divide="ignore", invalid="ignore"):
        (gain, offset, shift), shift_variance = _solution(moments)
        fits = (gain >= MIN_GAIN) & (total > 0)
        left = (seen[SEEN] - gain * seen[NEEDLE] - offset * seen[ONE] - shift * seen[SLOPE]) / total
        noise = np.maximum(left, 0.0)
        variance = (seen[SEEN] - seen[ONE] ** 2 / total) / total
        explained = np.where(variance > 0, 1.0 - noise / variance, 0.0)
        shift_sigma = np.sqrt(noise * np.maximum(shift_variance, 0.0) / pixels_per_sample)
        score = partial_correlation(moments) if len(moments) > FACE else np.full_like(total, np.nan)
        return Fits(
            fraction=np.where(fits, phase / PHASES_PER_ROW + shift / gain, np.nan),
            sigma_rows=np.where(fits, shift_sigma / gain, np.inf),
            score=np.where(fits, score, 0.0),
            noise=np.where(fits, noise, np.inf),
            gain=np.where(fits, gain, 0.0),
            correlation=np.where(fits, np.sqrt(np.maximum(explained, 0.0)), 0.0),
            offset=offset,
            shift=shift,
            phase=phase,
        )


def _solution(moments: Floats) -> tuple[tuple[Floats, Floats, Floats], Floats]:
    """As `fitting` has it."""
    a, c, b, x = moments[:FACE, NEEDLE]
    f, e, z = moments[SLOPE:FACE, SLOPE]
    d, y = moments[ONE:FACE, ONE]
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    determinant = np.where(determinant <= TINY * a * d * f, np.nan, determinant)
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    gain = (aa * x + bb * y + cc * z) / determinant
    offset = (bb * x + dd * y + ee * z) / determinant
    shift = (cc * x + ee * y + ff * z) / determinant
    return (gain, offset, shift), ff / determinant


def partial_correlation(moments: Floats) -> Floats:
    """As `fitting` has it."""
    total = np.maximum(moments[ONE, ONE], 1e-9)
    with_one = moments[WITH_ONE]
    shared = moments[SHARED] - with_one[SHARED_ONE] * with_one[SHARED_OTHER] / total
    of_face, needle_face, seen_face, of_needle, of_seen, seen_needle = shared
    of_face += total * FACE_NOISE_LEVELS**2
    needle_left = of_needle - needle_face**2 / of_face
    seen_left = of_seen - seen_face**2 / of_face
    both = seen_needle - needle_face * seen_face / of_face
    shown = np.minimum(needle_left, seen_left) > total * MIN_SPREAD_LEVELS**2
    correlation = np.divide(both, np.sqrt(needle_left * seen_left), out=np.zeros_like(both), where=shown)
    clipped: Floats = limited(correlation, -1.0, 1.0)
    return clipped
