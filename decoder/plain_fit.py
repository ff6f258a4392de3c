"""Fits of whole needles over their bare faces: the least squares of `fitting` with all sums told by a few products.

A needle over its face is `light + transparency * face`. What that is summed up to with itself and with the face changes
with the row only, and is worked out when a needle is first seen there; what a frame shows is summed up with the layers
of all phases at once. So a window's pixels are touched three times, however many steps the least squares take.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.fitting import FACE, MIDDLE_GREY, NEEDLE, ONE, PHASE_REACH, PHASES_PER_ROW, SEEN, SLOPE, phases_of
from decoder.needle_template import NeedleTemplate
from decoder.quick_fit import Fits, nearest_phases, solved

# How many phases away from a window's middle a needle may be looked for: half a row.
REACH = PHASES_PER_ROW // 2
PHASES = 2 * REACH + 1
# The sums that no frame changes: products of these two, of each phase and of all.
_OF_PHASE = ((NEEDLE, NEEDLE), (SLOPE, NEEDLE), (SLOPE, SLOPE), (ONE, NEEDLE), (ONE, SLOPE), (FACE, NEEDLE))
_OF_ALL = ((ONE, ONE), (FACE, ONE), (FACE, FACE))
_KNOWN = tuple(zip(*_OF_PHASE, *_OF_ALL, strict=True))


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
        # All levels count from the middle grey: smaller sums lose less.
        rows = np.concatenate(faces) - np.float32(MIDDLE_GREY)
        self._first = np.cumsum([0, *(len(face) for face in faces)])[:-1]
        height, columns = templates[0].pixels.shape
        shape, (row, column) = (len(rows) - height + 1, height * columns), rows.strides
        self._windows = np.ndarray(shape, rows.dtype, rows, strides=(row, column))
        transparency, light = (_layers(templates, name) for name in ("transparency", "light"))
        light += MIDDLE_GREY * transparency
        light[:, :, 0] -= MIDDLE_GREY
        trust = np.stack([template.trust.ravel() for template in templates]).astype(np.float32)
        self._with_seen = _with_seen(light, transparency, trust)
        self._with_square = trust[:, None]
        self._alike, self._with_face = _of_face(light, transparency, trust)
        self._known = np.empty((len(rows), PHASES, len(_OF_PHASE) + len(_OF_ALL)))
        self._is_known = np.zeros(len(rows), bool)

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
        rows = self._first + top_rows
        self._learn(rows)
        seen = windows.astype(np.float32)
        seen -= np.float32(MIDDLE_GREY)
        both = np.concatenate([seen, seen * self._windows[rows]], axis=2)
        with_seen = _products(self._with_seen, both)
        of_phase = with_seen[..., :-2].reshape(*rows.shape, PHASES, 2)
        moments = np.empty((5, 5, *rows.shape))
        moments[SEEN, ONE], moments[FACE, SEEN] = with_seen[..., -2], with_seen[..., -1]
        moments[SEEN, SEEN] = _products(self._with_square, np.square(seen, out=seen))[..., 0]

        def look(phase: Indices) -> None:
            moments[_KNOWN] = np.moveaxis(self._known[rows, phase + REACH], -1, 0)
            own = np.take_along_axis(of_phase, phase[..., None, None] + REACH, axis=2)[..., 0, :]
            moments[SEEN, :ONE] = np.moveaxis(own, -1, 0)

        phase = np.rint(guess_rows * PHASES_PER_ROW).astype(np.intp)
        look(phase)
        nearest = limited(nearest_phases(moments, phase), -REACH, REACH)
        if (nearest != phase).any():
            look(nearest)
        return solved(moments, nearest, self._pixels_per_sample)

    def _learn(self, rows: Indices) -> None:
        """Works out the sums for those rows that no frame had its needle on so far."""
        asked = np.zeros(len(self._is_known), bool)
        asked[rows] = True
        unknown = np.flatnonzero(asked & ~self._is_known)  # `np.unique` takes several times as long
        if not unknown.size:
            return
        faces = self._windows[unknown]
        both = np.concatenate([faces, faces * faces], axis=1)[..., None]
        ends = [*np.searchsorted(unknown, self._first).tolist(), len(unknown)]
        sums = np.concatenate(
            [
                alike + (with_face @ both[first:end])[..., 0]
                for alike, with_face, first, end in zip(self._alike, self._with_face, ends[:-1], ends[1:], strict=True)
            ]
        )
        of_phase, of_all = np.split(sums, [PHASES * len(_OF_PHASE)], axis=1)
        known = np.empty((len(unknown), *self._known.shape[1:]))
        known[..., : len(_OF_PHASE)] = of_phase.reshape(-1, PHASES, len(_OF_PHASE))
        known[..., len(_OF_PHASE) :] = of_all[:, None]
        self._known[unknown] = known
        self._is_known[unknown] = True


def _layers(templates: Sequence[NeedleTemplate], name: str) -> Floats:
    """(K, phases, 2, H * C) float32."""
    phases = slice(PHASE_REACH - REACH, PHASE_REACH + REACH + 1)
    layers = np.stack([getattr(phases_of(template), name)[phases] for template in templates])
    return layers.reshape(len(templates), PHASES, 2, -1)


def _of_face(light: Floats, transparency: Floats, trust: Floats) -> tuple[Floats, Floats]:
    """What the n known sums are: so much, (K, n), and (K, n, 2 * H * C) float32 by the face and by its square."""
    weights = trust[:, None]
    one, none = np.ones_like(weights), np.zeros_like(weights)
    plain = {NEEDLE: light[:, :, 0], SLOPE: light[:, :, 1], ONE: one, FACE: none}
    by_face = {NEEDLE: transparency[:, :, 0], SLOPE: transparency[:, :, 1], ONE: none, FACE: one}
    own = PHASES * len(_OF_PHASE)
    places = [slice(first, own, len(_OF_PHASE)) for first in range(len(_OF_PHASE))]
    places += [slice(own + number, own + number + 1) for number in range(len(_OF_ALL))]
    alike = np.empty((len(trust), own + len(_OF_ALL)))
    with_face = np.empty((*alike.shape, 2, trust.shape[1]), np.float32)
    for (first, second), place in zip((*_OF_PHASE, *_OF_ALL), places, strict=True):
        alike[:, place] = (plain[first] * plain[second] * weights).sum(axis=2)
        once = plain[first] * by_face[second] + by_face[first] * plain[second]
        np.multiply(once, weights, out=with_face[:, place, 0])
        np.multiply(by_face[first] * by_face[second], weights, out=with_face[:, place, 1])
    return alike, with_face.reshape(*alike.shape, -1)


def _with_seen(light: Floats, transparency: Floats, trust: Floats) -> Floats:
    """(K, phases * 2 + 2, 2 * H * C) float32: layers, 1 and the face by what is seen, and by that times the face."""
    needles, size = trust.shape
    kernels = np.zeros((needles, 2 * PHASES + 2, 2, size), np.float32)
    for part, layers in enumerate((light, transparency)):
        np.multiply(layers.reshape(needles, -1, size), trust[:, None], out=kernels[:, :-2, part])
        kernels[:, part - 2, part] = trust
    return kernels.reshape(needles, -1, 2 * size)


def _products(kernels: Floats, pixels: Floats) -> Floats:
    """(F, K, n) float64: kernels (K, n, p) with (F, K, p) of windows, each by a product of its own."""
    products: Floats = (kernels @ pixels[..., None])[..., 0].astype(np.float64)
    return products
