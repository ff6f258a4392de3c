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
# Frames whose sums are made together: more of them do not stay in the processor's cache.
AT_ONCE = 8
# Rows of the moments of `over_face.FaceMoments` in the batch.
TOTAL, FACE_MEAN, FACE_VARIANCE, NEEDLE_MEAN, NEEDLE_PER_FACE, NEEDLE_LEFT = range(6)


@dataclass(frozen=True, slots=True)
class Sought:
    """A needle to be searched for: its template, its dial without needles, and which of the gauges that is."""

    template: NeedleTemplate
    face: Floats
    gauge: int


@dataclass(frozen=True, slots=True)
class SearchedRows:
    """Where a needle's gauge and scores lie in the search.

    Attributes
    ----------
    gauge
        Which one it is.
    top, rows
        Of the thinned gauge in the search's image.
    first_row, last_row
        Of the whole gauge on which the needle's axis may lie.
    count
        Of scores.
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

    @property
    def start(self) -> int:
        """The row of the first score; the next is `COARSE_STEP` further."""
        return self.first_row - self.first_row % COARSE_STEP


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
        coarse = self.coarse([thinned_columns(gauge)[None] for gauge in gauges])
        return [self.spread(index, scores[0]) for index, scores in enumerate(coarse)]

    def coarse(self, gauges: Sequence[Floats]) -> list[Floats]:
        """For each needle (F, N) float32: its scores in F frames, on the rows that are searched alone.

        `gauges` are those that the needles name, (F, C', R') each: every third column and row. What is found in one
        frame does not depend on the frames beside it.
        """
        scores: dict[int, Floats] = {}
        for members, batch in zip(self._members, self._batches, strict=True):
            found = batch.scores(gauges)
            scores |= {member: found[:, index] for index, member in enumerate(members)}
        return [scores[index] for index in range(len(scores))]

    def place(self, needle: int) -> SearchedRows:
        """Which rows of its gauge are searched for a needle, by its index."""
        return next(
            batch.places[members.index(needle)]
            for members, batch in zip(self._members, self._batches, strict=True)
            if needle in members
        )

    def spread(self, needle: int, coarse: Floats) -> Floats:
        """The scores on every row, (R,), from a needle's (N,) on the rows that were searched."""
        return _spread(coarse, self.place(needle))


class _Batch:
    """Searches K needles; each gauge is padded to the longest, (C, R), and each template, (C, H), likewise.

    Rows lie side by side in memory, so that whole rows of products are added at once.
    """

    def __init__(self, sought: Sequence[Sought]) -> None:
        coarse = [thinned(each.template) for each in sought]
        faces = [thinned_columns(each.face) for each in sought]
        self._height = height = max(template.rows for template in coarse)
        (columns,) = {face.shape[0] for face in faces}
        self.places = [
            _place(each, template.rows, face.shape[1], height)
            for each, template, face in zip(sought, coarse, faces, strict=True)
        ]
        padded_rows = max(place.top + place.rows for place in self.places) + height // 2
        count = padded_rows - height + 1
        needles = len(sought)
        self._faces = np.zeros((needles, columns, padded_rows), np.float32)
        self._images = np.zeros((AT_ONCE, *self._faces.shape), np.float32)
        self._kernels = [np.zeros((needles, parts, height, columns), np.float32) for parts in (2, 2, 1)]
        self._moments = np.zeros((6, needles, count), np.float32)
        self._moments[[TOTAL, FACE_VARIANCE]] = 1.0
        for index, (template, face, place) in enumerate(zip(coarse, faces, self.places, strict=True)):
            self._prepare(index, template, face, place)
        self._usable = self._moments[NEEDLE_LEFT] > MIN_SPREAD_LEVELS**2

    def _prepare(self, index: int, template: NeedleTemplate, face: Floats, place: SearchedRows) -> None:
        self._faces[index, :, place.top : place.top + place.rows] = face
        own = face_moments(np.ascontiguousarray(face.T), template)
        weights, light, cover = own.kernels
        rows = slice(place.top, place.top + template.rows)
        for kernels, parts in zip(self._kernels, [(weights, light), (weights, cover), (weights,)], strict=True):
            kernels[index, :, rows] = np.stack(parts)
        known = (own.total, own.face_mean, own.face_variance, own.needle_mean, own.needle_per_face, own.needle_left)
        for number, values in enumerate(known):
            self._moments[number, index, : place.count] = values

    def scores(self, gauges: Sequence[Floats]) -> Floats:
        """(F, K, N): as `Search.coarse`."""
        frames = len(gauges[self.places[0].gauge])
        parts = [
            self._searched([gauge[first : first + AT_ONCE] for gauge in gauges]) for first in range(0, frames, AT_ONCE)
        ]
        return np.concatenate(parts)

    def _searched(self, gauges: Sequence[Floats]) -> Floats:
        frames = len(gauges[self.places[0].gauge])
        images = self._images[:frames]
        for index, place in enumerate(self.places):
            images[:, index, :, place.top : place.top + place.rows] = gauges[place.gauge]
        return self._partial(images)

    def _partial(self, images: Floats) -> Floats:
        """As `over_face.partial_normxcorr`, (F, K, N)."""
        total, face_mean, face_variance, needle_mean, needle_per_face, needle_left = self._moments
        mean, with_light = self._sums(images, self._kernels[0])
        with_face, with_cover = self._sums(images * self._faces, self._kernels[1])
        (square,) = self._sums(images * images, self._kernels[2])
        mean /= total
        square /= total
        square -= mean * mean
        with_face /= total
        with_face -= mean * face_mean
        with_light += with_cover
        with_light /= total
        mean *= needle_mean
        with_light -= mean
        left = square
        left -= with_face * with_face / face_variance
        with_light -= with_face * needle_per_face
        usable = self._usable & (left > MIN_SPREAD_LEVELS**2)
        np.sqrt(np.maximum(left, 0.0) * needle_left, out=left)
        scores: Floats = np.divide(with_light, left, out=np.zeros_like(left), where=usable)
        return np.clip(scores, -1.0, 1.0, out=scores)

    def _sums(self, images: Floats, kernels: Floats) -> Floats:
        """`correlation.sliding_sums` of (F, K, C, R) images with (K, P, H, C) kernels: (P, F, K, N).

        One product for each frame and needle, always of one shape: so frames do not change each other's rounding.
        """
        needles, parts, height, columns = kernels.shape
        products = kernels.reshape(needles, parts * height, columns) @ images
        count = products.shape[-1] - height + 1
        rows = np.moveaxis(products.reshape(*products.shape[:2], parts, height, -1), 2, 0)
        sums = rows[..., 0, :count] + rows[..., 1, 1 : 1 + count] if height > 1 else rows[..., 0, :count].copy()
        for row in range(2, height):
            sums += rows[..., row, row : row + count]
        return sums


def _spread(coarse: Floats, place: SearchedRows) -> Floats:
    """Scores on every row from those on every third."""
    coarse = coarse[: place.count]
    between = np.empty((place.count, COARSE_STEP), np.float32)
    step = (coarse[1:] - coarse[:-1]) * np.float32(1 / COARSE_STEP)
    between[:, 0] = coarse
    for part in range(1, COARSE_STEP):
        np.multiply(step, np.float32(part), out=between[:-1, part])
        between[:-1, part] += coarse[:-1]
    found = np.zeros(place.size, np.float32)
    searched = COARSE_STEP * (place.count - 1) + 1
    end = min(place.start + searched, place.last_row + 1)
    found[place.first_row : end] = between.ravel()[place.first_row - place.start : end - place.start]
    found[end : place.last_row + 1] = coarse[-1]
    return found


def _place(sought: Sought, height: int, rows: int, padded_height: int) -> SearchedRows:
    axis, size = (sought.template.rows - 1) // 2, len(sought.face)
    return SearchedRows(
        gauge=sought.gauge,
        top=(padded_height - height) // 2,
        rows=rows,
        first_row=axis,
        last_row=size - axis - 1,
        count=rows - height + 1,
        size=size,
    )


def thinned_columns(gauge: Floats) -> Floats:
    """(C', R'): every third column and row of an unwrapped gauge (R, C), rows side by side."""
    return gauge[::COARSE_STEP, ::COARSE_STEP].T


def thinned(template: NeedleTemplate) -> NeedleTemplate:
    """Every third row and column of a template, its axis among the rows."""
    skip = (template.rows - 1) // 2 % COARSE_STEP
    rows = slice(skip, template.rows - skip, COARSE_STEP)
    layers = {
        name: getattr(template, name)[rows, ::COARSE_STEP]
        for name in ("pixels", "weights", "light", "transparency", "trust")
    }
    return NeedleTemplate(**layers, step_deg=template.step_deg * COARSE_STEP)
