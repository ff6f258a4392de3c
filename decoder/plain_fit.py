"""Fits of whole needles over their bare faces: the least squares of `fitting` with all sums told by a few products.

A needle over its face is `light + transparency * face`. What that is summed up to with itself and with the face changes
with the row only, and is worked out once for each; what a frame shows is summed up with the layers of all phases at
once. So a window's pixels are touched three times, however many steps the least squares take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from decoder.arrays import Floats, Indices
from decoder.fitting import (
    FACE,
    MAX_FRACTION_ROWS,
    MIDDLE_GREY,
    NEEDLE,
    ONE,
    PHASES_PER_ROW,
    SEEN,
    SLOPE,
    Phase,
    phases_of,
)
from decoder.needle_template import NeedleTemplate
from decoder.quick_fit import Fits, solved

# The sums that no frame changes: products of these two, of each phase and of all.
_OF_PHASE = ((NEEDLE, NEEDLE), (NEEDLE, SLOPE), (SLOPE, SLOPE), (NEEDLE, ONE), (SLOPE, ONE), (NEEDLE, FACE))
_OF_ALL = ((ONE, ONE), (ONE, FACE), (FACE, FACE))


class PlainFitter:
    """Fits K needles whose templates have one shape, (H, C).

    Parameters
    ----------
    templates
        K of them.
    faces
        By needle the dial without needles, (R, C) float32.
    pixels_per_sample
        By needle, as of its gauge's grid.
    """

    def __init__(
        self, templates: Sequence[NeedleTemplate], faces: Sequence[Floats], pixels_per_sample: Sequence[float]
    ) -> None:
        self._pixels_per_sample = np.array(pixels_per_sample)
        self._size = templates[0].pixels.size
        # All levels count from the middle grey: smaller sums lose less.
        self._faces = [
            np.lib.stride_tricks.sliding_window_view((face - np.float32(MIDDLE_GREY)).ravel(), self._size)
            for face in faces
        ]
        self._columns = templates[0].pixels.shape[1]
        phases = [phases_of(template) for template in templates]
        self._reach = max(phases[0])
        transparency = _stacked(phases, "transparency")  # (K, phases, 2, H * C)
        light = _stacked(phases, "light") + MIDDLE_GREY * transparency
        light[:, :, 0] -= MIDDLE_GREY
        trust = np.stack([template.trust.ravel() for template in templates]).astype(np.float64)
        every = trust[:, None]
        self._with_seen = _kernels(light, trust)
        self._with_both = _kernels(transparency, trust)
        self._with_square = every.astype(np.float32)
        self._knowing = [_Known(*own) for own in zip(light, transparency, trust, strict=True)]
        rows = max(len(face) for face in faces)
        self._known = np.full((len(templates), rows, 2 * self._reach + 1, len(_OF_PHASE)), np.nan)
        self._known_of_all = np.full((len(templates), rows, len(_OF_ALL)), np.nan)

    def fit(self, windows: Floats, top_rows: Indices, guess_rows: Floats) -> Fits:
        """Each needle in F frames, (F, K) each.

        Parameters
        ----------
        windows : (F, K, H * C) uint8 or float32
        top_rows : (F, K)
            The rows of the gauges on which the windows begin.
        guess_rows : (F, K)
            How far below the windows' middles the needles are expected, at most half a row.
        """
        seen = windows.astype(np.float32)
        seen -= np.float32(MIDDLE_GREY)
        faces = np.stack([face[top_rows[:, needle] * self._columns] for needle, face in enumerate(self._faces)], axis=1)
        self._learn(top_rows, faces)
        with_seen = _products(self._with_seen, seen)
        with_both = _products(self._with_both, seen * faces)
        square = _products(self._with_square, seen * seen)[..., 0]
        of_phase = (with_seen[..., :-1] + with_both[..., :-1]).reshape(*top_rows.shape, -1, 2)
        frames, needles = np.indices(top_rows.shape)
        moments = np.full((5, 5, *top_rows.shape), np.nan)  # of slope and face nobody asks
        of_all = np.moveaxis(self._known_of_all[needles, top_rows], -1, 0)
        alike = [(*pair, values) for pair, values in zip(_OF_ALL, of_all, strict=True)]
        alike += [(SEEN, ONE, with_seen[..., -1]), (SEEN, FACE, with_both[..., -1]), (SEEN, SEEN, square)]

        def step(phase: Indices) -> Fits:
            known = np.moveaxis(self._known[needles, top_rows, phase + self._reach], -1, 0)
            own = of_phase[frames, needles, phase + self._reach]
            changing = [(*pair, values) for pair, values in zip(_OF_PHASE, known, strict=True)]
            changing += [(SEEN, NEEDLE, own[..., 0]), (SEEN, SLOPE, own[..., 1])]
            for one, other, values in (*alike, *changing):
                moments[one, other] = moments[other, one] = values
            return solved(moments, phase, self._pixels_per_sample)

        guess = np.rint(guess_rows * PHASES_PER_ROW).astype(np.intp)
        first = step(guess)
        near = np.abs(first.fraction) <= MAX_FRACTION_ROWS  # not where it is NaN
        nearest = np.rint(np.where(near, first.fraction, 0.0) * PHASES_PER_ROW).astype(np.intp)
        again = near & (nearest != guess)
        if not again.any():
            return first
        return step(np.where(again, nearest, guess))

    def _learn(self, top_rows: Indices, faces: Floats) -> None:
        """Works out the sums for those rows that no frame had its needle on so far."""
        unknown = np.isnan(self._known_of_all[np.arange(len(self._knowing)), top_rows, 0])
        for needle in np.flatnonzero(unknown.any(axis=0)).tolist():
            frames = np.flatnonzero(unknown[:, needle])
            rows, first = np.unique(top_rows[frames, needle], return_index=True)
            of_phase, of_all = self._knowing[needle].sums(faces[frames[first], needle].astype(np.float64))
            self._known[needle, rows], self._known_of_all[needle, rows] = of_phase, of_all


class _Known:
    """The sums of one needle that no frame changes: as sums of its face, and of the face's square, in one window.

    `light` and `transparency` are (phases, 2, H * C), `trust` (H * C,).
    """

    def __init__(self, light: Floats, transparency: Floats, trust: Floats) -> None:
        (needle, slope), (clear, change) = light.swapaxes(0, 1), transparency.swapaxes(0, 1)
        by_trust = (each * trust for each in (needle, slope, clear, change))
        own_needle, own_slope, own_clear, own_change = by_trust
        alone = (own_needle * needle, own_needle * slope, own_slope * slope, own_needle, own_slope, None)
        once = (2 * own_needle * clear, own_needle * change + own_slope * clear, 2 * own_slope * change)
        twice = (own_clear * clear, own_clear * change, own_change * change, None, None, own_clear)
        self._plain = np.stack([np.zeros(len(light)) if each is None else each.sum(axis=1) for each in alone], axis=1)
        self._with_face = _with_trust((*once, own_clear, own_change, own_needle), trust)
        self._with_square = _with_trust(twice, trust)
        self._total = float(trust.sum())

    def sums(self, faces: Floats) -> tuple[Floats, Floats]:
        """Over M faces, (M, H * C) float64: those of each phase, (M, phases, 6), and those of all, (M, 3)."""
        once = (self._with_face @ faces[..., None])[..., 0]
        twice = (self._with_square @ (faces * faces)[..., None])[..., 0]
        of_phase = self._plain + (once[:, :-1] + twice[:, :-1]).reshape(len(faces), *self._plain.shape)
        return of_phase, np.stack([np.full(len(faces), self._total), once[:, -1], twice[:, -1]], axis=1)


def _with_trust(kernels: Sequence[Floats | None], trust: Floats) -> Floats:
    """(phases * 6 + 1, H * C): six kernels (phases, H * C), where there are none nothing, and `trust` (H * C,)."""
    phases = max(len(each) for each in kernels if each is not None)
    both = np.zeros((phases * len(kernels) + 1, len(trust)))
    for number, each in enumerate(kernels):
        if each is not None:
            both[number : -1 : len(kernels)] = each
    both[-1] = trust
    return both


def _stacked(phases: Sequence[Mapping[int, Phase]], name: str) -> Floats:
    """(K, phases, 2, H * C) float64."""
    layers = [[getattr(own[step], name).reshape(2, -1) for step in sorted(own)] for own in phases]
    return np.array(layers, np.float64)


def _kernels(layers: Floats, trust: Floats) -> Floats:
    """(K, phases * 2 + 1, H * C) float32: layers (K, phases, 2, H * C) by trust (K, H * C), and that itself."""
    weighted = (layers * trust[:, None, None]).reshape(len(trust), -1, trust.shape[1])
    return np.concatenate([weighted, trust[:, None]], axis=1).astype(np.float32)


def _products(kernels: Floats, pixels: Floats) -> Floats:
    """(F, K, n) float64: kernels (K, n, H * C) with pixels (F, K, H * C), each window by a product of its own."""
    products: Floats = (kernels @ pixels[..., None])[..., 0].astype(np.float64)
    return products
