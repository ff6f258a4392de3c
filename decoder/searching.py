"""The search: how well each needle of a panel matches on every row of its gauge, for all gauges of a frame at once.

The scores are those of `over_face`, found on every third row and column and laid out so that one pass of array
arithmetic serves all needles: at this size a call costs more than its sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.needle_template import NeedleTemplate
from decoder.over_face import face_moments

# Scores are searched on every third row and column; a needle is wider than that.
COARSE_STEP = 3
# Rows of the moments of `over_face.FaceMoments` in the batch.
TOTAL, FACE_MEAN, FACE_VARIANCE, NEEDLE_MEAN, NEEDLE_PER_FACE, NEEDLE_LEFT = range(6)


@dataclass(frozen=True, slots=True)
class Sought:
    """A needle to be searched for: its template, its dial without needles, and which of the gauges that is."""

    template: NeedleTemplate
    face: Floats
    gauge: int


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a needle's gauge and scores lie in the batch.

    Attributes
    ----------
    gauge
        Which one it is.
    top, rows
        Of the thinned gauge in the batch's image.
    first_row, last_row
        Of the whole gauge on which the needle's axis may lie.
    count
        Of scores in the batch.
    size
        Rows of the whole gauge.
    """

    gauge: int
    top: int
    rows: int
    first_row: int
    last_row: int
    count: int
    size: int


class Search:
    """Searches any needles; those on gauges with equally many columns, which are of much the same size, together."""

    def __init__(self, sought: Sequence[Sought]) -> None:
        widths = [each.face.shape[1] for each in sought]
        self._members = [
            [index for index, each in enumerate(widths) if each == width] for width in dict.fromkeys(widths)
        ]
        self._batches = [_Batch([sought[index] for index in members]) for members in self._members]

    def scores(self, gauges: Sequence[Floats]) -> list[Floats]:
        """For each needle (R,) float32: the NCC, what the face explains taken out, by the row of the needle's axis.

        `gauges` are those that the needles name, (R, C) float32 each. On the rows between those that were searched
        scores lie on the line; rows too near an end of the gauge score 0.
        """
        scores: dict[int, Floats] = {}
        for members, batch in zip(self._members, self._batches, strict=True):
            scores |= zip(members, batch.scores(gauges), strict=True)
        return [scores[index] for index in range(len(scores))]


class _Batch:
    """Searches K needles; each gauge is padded to the longest, (R, C), and each template, (H, C), likewise."""

    def __init__(self, sought: Sequence[Sought]) -> None:
        coarse = [thinned(each.template) for each in sought]
        faces = [each.face[::COARSE_STEP, ::COARSE_STEP] for each in sought]
        height = max(template.rows for template in coarse)
        (columns,) = {face.shape[1] for face in faces}
        self._places = [
            _place(each, template.rows, face.shape, height)
            for each, template, face in zip(sought, coarse, faces, strict=True)
        ]
        padded_rows = max(place.top + place.rows for place in self._places) + height // 2
        count = padded_rows - height + 1
        needles = len(sought)
        self._gauges = np.zeros((needles, padded_rows, columns), np.float32)
        self._faces = np.zeros_like(self._gauges)
        self._kernels = [np.zeros((needles, columns, parts, height), np.float32) for parts in (2, 2, 1)]
        self._moments = np.zeros((6, needles, count), np.float32)
        self._moments[[TOTAL, FACE_VARIANCE]] = 1.0
        for index, (template, face, place) in enumerate(zip(coarse, faces, self._places, strict=True)):
            self._prepare(index, template, face, place)
        self._usable = self._moments[NEEDLE_LEFT] > MIN_SPREAD_LEVELS**2

    def _prepare(self, index: int, template: NeedleTemplate, face: Floats, place: _Place) -> None:
        self._faces[index, place.top : place.top + place.rows] = face
        own = face_moments(np.ascontiguousarray(face), template)
        weights, light, cover = own.kernels.transpose(0, 2, 1)
        rows = slice(place.top, place.top + template.rows)
        for kernels, parts in zip(self._kernels, [(weights, light), (weights, cover), (weights,)], strict=True):
            kernels[index, :, :, rows] = np.stack(parts, axis=1)
        known = (own.total, own.face_mean, own.face_variance, own.needle_mean, own.needle_per_face, own.needle_left)
        for number, values in enumerate(known):
            self._moments[number, index, : place.count] = values

    def scores(self, gauges: Sequence[Floats]) -> list[Floats]:
        """As `Search.scores`."""
        images = self._gauges
        for index, place in enumerate(self._places):
            images[index, place.top : place.top + place.rows] = gauges[place.gauge][::COARSE_STEP, ::COARSE_STEP]
        return self._spread(self._partial(images))

    def _partial(self, images: Floats) -> Floats:
        """As `over_face.partial_normxcorr`, (K, N)."""
        total, face_mean, face_variance, needle_mean, needle_per_face, needle_left = self._moments
        over_faces = images * self._faces
        mean, with_light = self._sums(images, self._kernels[0])
        with_face, with_cover = self._sums(over_faces, self._kernels[1])
        square = self._sums(images * images, self._kernels[2])[0]
        mean /= total
        variance = square / total
        variance -= mean * mean
        with_face /= total
        with_face -= mean * face_mean
        with_light += with_cover
        with_light /= total
        with_light -= mean * needle_mean
        left = variance - with_face * with_face / face_variance
        with_light -= with_face * needle_per_face
        usable = self._usable & (left > MIN_SPREAD_LEVELS**2)
        np.sqrt(np.maximum(left, 0.0) * needle_left, out=left)
        scores: Floats = np.divide(with_light, left, out=np.zeros_like(left), where=usable)
        return np.minimum(np.maximum(scores, -1.0), 1.0)

    def _sums(self, images: Floats, kernels: Floats) -> Floats:
        """`correlation.sliding_sums` of (K, R, C) images with (K, C, P, H) kernels: (P, K, N)."""
        needles, columns, parts, height = kernels.shape
        products = images @ kernels.reshape(needles, columns, parts * height)
        needle, row, column = products.strides
        shape = (parts, needles, images.shape[1] - height + 1, height)
        strides = (height * column, needle, row, row + column)
        diagonals: Floats = np.ndarray(shape, products.dtype, products, strides=strides)
        sums: Floats = np.add.reduce(diagonals, axis=3)
        return sums

    def _spread(self, coarse: Floats) -> list[Floats]:
        """Scores on every row from those on every third, (K, N)."""
        step = (coarse[:, 1:] - coarse[:, :-1]) * np.float32(1 / COARSE_STEP)
        between = np.empty((*coarse.shape, COARSE_STEP), np.float32)
        between[:, :, 0] = coarse
        for part in range(1, COARSE_STEP):
            np.multiply(step, np.float32(part), out=between[:, :-1, part])
            between[:, :-1, part] += coarse[:, :-1]
        flat = between.reshape(len(coarse), -1)
        return [self._placed(scores, place) for scores, place in zip(flat, self._places, strict=True)]

    @staticmethod
    def _placed(scores: Floats, place: _Place) -> Floats:
        found = np.zeros(place.size, np.float32)
        searched = COARSE_STEP * (place.count - 1) + 1
        start = place.first_row - place.first_row % COARSE_STEP
        end = min(start + searched, place.last_row + 1)
        found[place.first_row : end] = scores[place.first_row - start : end - start]
        found[end : place.last_row + 1] = scores[searched - 1]
        return found


def _place(sought: Sought, height: int, shape: tuple[int, ...], padded_height: int) -> _Place:
    axis, size = (sought.template.rows - 1) // 2, len(sought.face)
    return _Place(
        gauge=sought.gauge,
        top=(padded_height - height) // 2,
        rows=shape[0],
        first_row=axis,
        last_row=size - axis - 1,
        count=shape[0] - height + 1,
        size=size,
    )


def thinned(template: NeedleTemplate) -> NeedleTemplate:
    """Every third row and column of a template, its axis among the rows."""
    skip = (template.rows - 1) // 2 % COARSE_STEP
    rows = slice(skip, template.rows - skip, COARSE_STEP)
    layers = {
        name: getattr(template, name)[rows, ::COARSE_STEP]
        for name in ("pixels", "weights", "light", "transparency", "trust")
    }
    return NeedleTemplate(**layers, step_deg=template.step_deg * COARSE_STEP)
