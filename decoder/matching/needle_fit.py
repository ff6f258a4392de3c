"""Least squares of a needle over its face for gain, offset and shift, in many windows at once.

The solution is the maximum of the NCC between rows. The fit is linear in the shift, so it is done twice: first with the
needle where it is expected, then with the needle moved to the half row nearest to the first result.

Each window is summed by a product of its own, always of the same shape, and everything else is elementwise, so a fit
does not depend on the others in the batch.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.matching.correlation import FaceMoments, partial_ncc
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import cubic_weights
from decoder.matching.thresholds import MAX_FRACTION_ROWS, MAX_STEPS, MIN_CONTRAST_PART
from decoder.panel.arrays import Floats, Indices, Mask, limited

PHASES_PER_ROW = 2
# The furthest phase to either side that a fit may need.
PHASE_REACH = math.ceil(MAX_FRACTION_ROWS * PHASES_PER_ROW)
MIDDLE_GREY = 128.0
ROUNDING = np.finfo(np.float32).eps
# Regularises the normal matrix of several lights, relative to its trace.
LIGHT_HOLD = 1e-12

# Rows of the moment matrix: the needle over the face, its derivative along the rows, 1, the gauge, and the face alone.
NEEDLE, SLOPE, ONE, SEEN, FACE = range(5)

BehindWindows = Callable[[Indices | slice, Floats], Floats]
"""Gives what lies behind the needle in some of the windows, (M', H * C), with this transparency there."""


@dataclass(frozen=True, slots=True)
class Phases:
    """The template moved by every half row that a fit may need, from the furthest up to the furthest down.

    `light` and `transparency`, (2 * PHASE_REACH + 1, 2, H, C) each, are its layers and their derivatives by its
    movement; at index PHASE_REACH it is unmoved.
    """

    light: Floats
    transparency: Floats


def phases_of(template: NeedleTemplate) -> Phases:
    """Return the template moved by every half row that a fit may need."""
    return template.once(_phases)


def _phases(template: NeedleTemplate) -> Phases:
    rows, columns = template.pixels.shape
    margin = PHASE_REACH + 1
    within = limited(np.arange(-margin, rows + margin), 0, rows - 1)
    padded = np.stack([template.light[within], template.transparency[within]])
    # light and transparency of the template and their changes: (2, phases, 2, H, C)
    layers = np.empty((2, 2 * PHASE_REACH + 1, 2, rows, columns), np.float32)
    between: dict[float, Floats] = {}  # by fraction of a row: phases a whole row apart share their rows
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
    """(2, R - 3, C): layers (2, R, C) interpolated a part of a row below each row except the first and the last two."""
    count = layers.shape[1] - 3
    first, *others = (
        np.float32(weight) * layers[:, tap : tap + count] for tap, weight in enumerate(cubic_weights(part)) if weight
    )
    found: Floats = first
    for other in others:
        found += other
    return found


@dataclass(frozen=True, slots=True)
class Fits:
    """Least squares in M windows of H by C pixels; all arrays (M,), float64.

    Attributes
    ----------
    fraction, sigma_rows
        How many rows below the window's middle the needle lies, NaN where none fits, with its uncertainty.
    score
        The partial NCC of gauge and needle, given the face: in [-1, 1].
    noise
        The mean square residual, grey levels squared.
    gain
        The needle's contrast in units of the template's.
    correlation
        Of the window with the needle over the face, the thesis's NCC for this one place.
    """

    fraction: Floats
    sigma_rows: Floats
    score: Floats
    noise: Floats
    gain: Floats
    correlation: Floats


class WindowFitter:
    """Fits needles whose templates have one shape (H, C), in many windows.

    Parameters
    ----------
    templates
        One for each needle.
    pixels_per_sample
        For each needle, how much of an original pixel one sample of its gauge covers.
    lights
        (L, H * C): what else may be added over a window, in any amount; by default a constant.
    """

    def __init__(
        self,
        templates: Sequence[NeedleTemplate],
        pixels_per_sample: Sequence[float],
        lights: Floats | None = None,
    ) -> None:
        self._pixels_per_sample = np.array(pixels_per_sample)
        phases = [phases_of(template) for template in templates]
        # (needles, phases, 2, H * C): light and transparency, and their derivatives by the needle's movement
        self._light, self._transparency = (
            np.stack([getattr(own, name).reshape(2 * PHASE_REACH + 1, 2, -1) for own in phases])
            for name in ("light", "transparency")
        )
        self._trust = np.stack([template.trust.ravel() for template in templates])
        self._lights = lights

    def fit(
        self,
        windows: Floats,
        faces: Floats,
        guess_rows: Floats,
        *,
        needles: Indices | int = 0,
        masks: Floats | None = None,
        behind: BehindWindows | None = None,
    ) -> Fits:
        """Fit a needle in each window, over what lies behind it there.

        Parameters
        ----------
        windows, faces : (M, H * C) float32
        guess_rows : (M,)
            How far below the window's middle the needle is expected, at most half a row.
        needles
            (M,): which needle it is.
        masks : (M, H * C) float32
            0 where pixels are left out.
        behind
            What lies behind the needles, if that is not the face alone.
        """
        which = np.broadcast_to(needles, guess_rows.shape)
        weights = self._trust[which] if masks is None else self._trust[which] * masks

        def moments_at(chosen: Indices | slice, phase: Indices) -> Floats:
            own = which[chosen], phase + PHASE_REACH
            transparency = self._transparency[own]
            back = faces[chosen] if behind is None else behind(chosen, transparency[:, 0])
            layers = _layers(self._light[own], transparency, back, windows[chosen])
            return self._moments(layers, weights[chosen])

        guess = np.rint(guess_rows * PHASES_PER_ROW).astype(np.intp)
        moments = moments_at(slice(None), guess)
        phase = nearest_phases(moments, guess)
        again = np.flatnonzero(phase != guess)
        if again.size:
            moments[..., again] = moments_at(again, phase[again])
        return solved(moments, phase, self._pixels_per_sample[which])

    def _moments(self, layers: Floats, weights: Floats) -> Floats:
        """(5, 5, M) float64: the weighted sums of products of layers (M, 5, H * C), with lights projected out."""
        if self._lights is None:
            plain: Floats = summed_products(layers, weights[:, None]).transpose(1, 2, 0)
            return plain
        count = len(self._lights)
        lights = np.broadcast_to(self._lights, (len(layers), *self._lights.shape))
        sums = summed_products(np.concatenate([lights, layers], axis=1), weights[:, None])
        of_light, shared = sums[:, :count, :count], sums[:, :count, count:]
        hold = LIGHT_HOLD * (1.0 + np.trace(of_light, axis1=1, axis2=2))[:, None, None] * np.eye(count)
        left = sums[:, count:, count:] - shared.transpose(0, 2, 1) @ np.linalg.solve(of_light + hold, shared)
        left[:, ONE] = left[:, :, ONE] = 0.0  # the lights include a constant
        left[:, ONE, ONE] = sums[:, count + ONE, count + ONE]
        moments: Floats = left.transpose(1, 2, 0)
        return moments


def _layers(light: Floats, transparency: Floats, back: Floats, windows: Floats) -> Floats:
    """(M, 5, H * C) float32, in the order of the moment matrix."""
    rows = np.empty((len(windows), 5, windows.shape[1]), np.float32)
    layers = rows[:, :ONE]
    np.multiply(transparency, back[:, None], out=layers)
    layers += light
    rows[:, ONE] = 1.0
    np.subtract(windows, np.float32(MIDDLE_GREY), out=rows[:, SEEN])
    rows[:, FACE] = back
    return rows


def summed_products(layers: Floats, weights: Floats) -> Floats:
    """(M, K, K) float64: the weighted sums of products of any two of K layers (M, K, H * C)."""
    weighted = layers * weights
    # a dot product per pair: for so few rows, the overhead of a matrix product dominates
    sums: Floats = np.vecdot(weighted[:, :, None], layers[:, None]).astype(np.float64)
    return sums


def nearest_phases(moments: Floats, phase: Indices) -> Indices:
    """(M,): the phase nearest to where least squares find the needle; unchanged where that is in another window."""
    with np.errstate(divide="ignore", invalid="ignore"):
        (gain, _, shift), _ = _solutions(moments)
        fraction = phase / PHASES_PER_ROW + shift / gain
        near = (gain >= MIN_CONTRAST_PART) & (moments[ONE, ONE] > 0) & (np.abs(fraction) <= MAX_FRACTION_ROWS)
        return np.where(near, np.rint(fraction * PHASES_PER_ROW), phase).astype(np.intp)


def solved(moments: Floats, phase: Indices, pixels_per_sample: Floats | float) -> Fits:
    """Solve for gain, offset and shift from moments (5, 5, M), or at least their first four rows and columns.

    Moments are symmetric; only the entries on and below the diagonal are used.
    """
    total, seen = moments[ONE, ONE], moments[SEEN]
    with np.errstate(divide="ignore", invalid="ignore"):
        (gain, offset, shift), shift_variance = _solutions(moments)
        fits = (gain >= MIN_CONTRAST_PART) & (total > 0)
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
        )


def _solutions(moments: Floats) -> tuple[tuple[Floats, Floats, Floats], Floats]:
    """Return gain, offset and shift of each window, and the variance factor of its shift."""
    a, c, b, x = moments[:FACE, NEEDLE]
    f, e, z = moments[SLOPE:FACE, SLOPE]
    d, y = moments[ONE:FACE, ONE]
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    determinant = np.where(determinant <= ROUNDING * a * d * f, np.nan, determinant)
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    gain = (aa * x + bb * y + cc * z) / determinant
    offset = (bb * x + dd * y + ee * z) / determinant
    shift = (cc * x + ee * y + ff * z) / determinant
    return (gain, offset, shift), ff / determinant


def partial_correlation(moments: Floats) -> Floats:
    """Return the partial NCC of needle and gauge, given the face, from moments (5, 5, M): (M,)."""
    total = np.maximum(moments[ONE, ONE], ROUNDING)
    means = moments / total
    known = FaceMoments.of_means(
        total,
        (
            means[FACE, ONE],
            means[FACE, FACE],
            means[ONE, NEEDLE],
            means[FACE, NEEDLE],
            means[NEEDLE, NEEDLE],
        ),
    )
    return partial_ncc(known, means[SEEN, ONE], means[SEEN, SEEN], means[FACE, SEEN], means[SEEN, NEEDLE])


@dataclass(frozen=True, slots=True)
class Settled:
    """Where the needles of M windows were found; (M,) each.

    Attributes
    ----------
    row
        Of the needle's axis; NaN where least squares diverged.
    sigma_rows, score, correlation, gain
        As in `Fits`.
    is_settled
        Whether the last fit lies in its own window, so that the windows converged.
    """

    row: Floats
    sigma_rows: Floats
    score: Floats
    correlation: Floats
    gain: Floats
    is_settled: Mask


FitAround = Callable[[Indices, Indices, Floats], Fits]
"""Fits some of the windows, (M',), around rows of the gauge, the needle so far below each."""


def settle(fit: FitAround, places: Floats, limits: tuple[Floats | int, Floats | int], reach_rows: float) -> Settled:
    """Move windows to where their needles lie until they stay there.

    Parameters
    ----------
    places
        (M,): the fractional rows at which the needles are expected.
    limits
        The first and the last row around which a window fits into its gauge.
    reach_rows
        The furthest a needle may turn out to be from its place.
    """
    low, high = (np.broadcast_to(limit, places.shape) for limit in limits)
    rows = limited(np.rint(places), low, high).astype(np.intp)
    guess_rows = limited(places - rows, -0.5, 0.5)
    found = np.full((5, len(rows)), np.nan)
    is_settled, open_ = np.zeros(len(rows), bool), np.arange(len(rows))
    for _ in range(MAX_STEPS):
        fits = fit(open_, rows[open_], guess_rows[open_])
        there = rows[open_] + fits.fraction
        within = np.abs(there - places[open_]) <= reach_rows
        done = within & (np.abs(fits.fraction) <= MAX_FRACTION_ROWS)
        values = np.stack([there, fits.sigma_rows, fits.score, fits.correlation, fits.gain])
        found[:, open_[within]] = values[:, within]
        is_settled[open_[done]] = True
        further = within & ~done
        open_, moved = open_[further], np.rint(there[further])
        if not open_.size:
            break
        rows[open_] = limited(moved, low[open_], high[open_]).astype(np.intp)
        guess_rows[open_] = 0.0
    row, sigma_rows, score, correlation, gain = found
    return Settled(row, sigma_rows, score, correlation, gain, is_settled)
