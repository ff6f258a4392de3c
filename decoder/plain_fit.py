"""Fits of whole needles over their bare faces: the least squares of `fitting` with all sums told by a few products.

A needle over its face is `light + transparency * face`. What that is summed up to with itself and with the face changes
with the row only, and is worked out once for each; what a frame shows is summed up with the layers of all phases at
once. So a window's pixels are touched three times, however many steps the least squares take.
"""

from __future__ import annotations

from collections.abc import Sequence

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

# The sums that no frame changes: products of these two.
_KNOWN = (
    (NEEDLE, NEEDLE),
    (NEEDLE, SLOPE),
    (NEEDLE, ONE),
    (NEEDLE, FACE),
    (SLOPE, SLOPE),
    (SLOPE, ONE),
    (ONE, ONE),
    (ONE, FACE),
    (FACE, FACE),
)


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
        self._light, self._transparency, self._trust = light, transparency, trust
        weights = trust[:, None]
        layers = (len(templates), -1, self._size)
        self._with_seen = np.concatenate([(light * weights[:, None]).reshape(layers), weights], axis=1).astype(
            np.float32
        )
        self._with_both = np.concatenate([(transparency * weights[:, None]).reshape(layers), weights], axis=1).astype(
            np.float32
        )
        rows = max(len(face) for face in faces)
        self._known = np.full((len(templates), rows, 2 * self._reach + 1, len(_KNOWN)), np.nan)

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
        square = _products((self._trust[:, None]).astype(np.float32), seen * seen)[..., 0]
        dynamic = (with_seen[..., :-1] + with_both[..., :-1]).reshape(*top_rows.shape, -1, 2)

        def step(phase: Indices) -> Fits:
            frames, every = np.indices(top_rows.shape)
            moments = np.empty((5, 5, *top_rows.shape))
            known = self._known[every, top_rows, phase + self._reach]
            for number, (one, other) in enumerate(_KNOWN):
                moments[one, other] = moments[other, one] = known[..., number]
            own = dynamic[frames, every, phase + self._reach]
            for other, values in (
                (NEEDLE, own[..., 0]),
                (SLOPE, own[..., 1]),
                (ONE, with_seen[..., -1]),
                (FACE, with_both[..., -1]),
            ):
                moments[SEEN, other] = moments[other, SEEN] = values
            moments[SEEN, SEEN] = square
            moments[SLOPE, FACE] = moments[FACE, SLOPE] = np.nan  # nobody asks
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
        for needle in range(len(self._faces)):
            rows, first = np.unique(top_rows[:, needle], return_index=True)
            new = np.isnan(self._known[needle, rows, 0, 0])
            for row, face in zip(rows[new].tolist(), faces[first[new], needle].astype(np.float64), strict=True):
                self._known[needle, row] = self._sums(needle, face)

    def _sums(self, needle: int, face: Floats) -> Floats:
        """(phases, known sums): over the face (H * C,) in one window."""
        layers = np.empty((2 * self._reach + 1, 4, self._size))
        layers[:, :2] = self._light[needle] + self._transparency[needle] * face
        layers[:, 2] = 1.0
        layers[:, 3] = face
        products = (layers * self._trust[needle]) @ layers.transpose(0, 2, 1)
        place = {NEEDLE: 0, SLOPE: 1, ONE: 2, FACE: 3}
        return np.stack([products[:, place[one], place[other]] for one, other in _KNOWN], axis=1)


def _stacked(phases: Sequence[dict[int, Phase]], name: str) -> Floats:
    return np.stack([[getattr(own[step], name).reshape(2, -1) for step in sorted(own)] for own in phases]).astype(
        np.float64
    )


def _products(kernels: Floats, pixels: Floats) -> Floats:
    """(F, K, n) float64: kernels (K, n, H * C) with pixels (F, K, H * C), each window by a product of its own."""
    products: Floats = (kernels @ pixels[..., None])[..., 0].astype(np.float64)
    return products
