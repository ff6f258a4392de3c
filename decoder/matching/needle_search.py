"""The search: how well each needle of a panel matches on every row of its gauge, for all gauges of many frames at once.

The scores are those of `correlation`, on every third row and column, laid out so that one pass of array arithmetic
serves all needles: for arrays this small, a call costs more than its sums.

The searched rows are interleaved over lanes, so that neighbouring lanes hold consecutive rows. The template is stored
once for each lane it may start on. One product with it sums as many of its rows as there are lanes, and a few such sums
make one score.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decoder.matching.correlation import FaceMoments, face_moments, partial_ncc
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats, Indices, Mask, limited

# Scores are searched on every third row and column; a needle is wider than that.
COARSE_STEP = 3
# More lanes make fewer, longer sums, but also more multiplications by zero.
LANES = 5
# Matrix libraries process this many rows of a kernel at a time; a remainder costs as much as a full block.
ROWS_AT_ONCE = 4
# How many numbers are summed together; more would not stay in the processor's cache.
AT_ONCE = 6 << 16


@dataclass(frozen=True, slots=True)
class SearchTarget:
    """A needle to search for: its template, its dial without needles, and which gauge that is."""

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
    first_row, last_row
        Of the whole gauge, between which the needle's axis may lie.
    count
        Of scores.
    size
        Rows of the whole gauge.
    """

    gauge: int
    first_row: int
    last_row: int
    count: int
    size: int

    @property
    def start(self) -> int:
        """The row of the first score; the next is `COARSE_STEP` further."""
        return self.first_row - self.first_row % COARSE_STEP


class Search:
    """Searches any needles; those on gauges with the same number of columns, which are of similar size, together."""

    def __init__(self, sought: Sequence[SearchTarget]) -> None:
        widths = [each.face.shape[1] for each in sought]
        self._members = [
            [index for index, each in enumerate(widths) if each == width] for width in dict.fromkeys(widths)
        ]
        self._batches = [_Batch([sought[index] for index in members]) for members in self._members]
        places = {
            member: place
            for members, batch in zip(self._members, self._batches, strict=True)
            for member, place in zip(members, batch.places, strict=True)
        }
        self.places = [places[member] for member in range(len(sought))]
        self.count = max(batch.count for batch in self._batches)

    def scores(self, gauges: Sequence[Floats]) -> Floats:
        """Return each needle's partial NCC in F frames on the searched rows, padded with zeros: (F, K, N) float32.

        `gauges` are those that the needles name, in F frames, each as made by `interleave_rows`. The result for a frame
        does not depend on the other frames.
        """
        if len(self._batches) == 1:
            return self._batches[0].scores(gauges)
        scores = np.zeros((len(gauges[0]), len(self.places), self.count), np.float32)
        for members, batch in zip(self._members, self._batches, strict=True):
            scores[:, members, : batch.count] = batch.scores(gauges)
        return scores


class _Batch:
    """Searches K needles on gauges with the same number of columns, each padded to the longest.

    The interleaved rows of a gauge are one array (lanes * columns, M): row m of every lane is a column of it.
    """

    def __init__(self, sought: Sequence[SearchTarget]) -> None:
        coarse = [thinned(each.template) for each in sought]
        faces = [interleave_rows(each.face) for each in sought]
        self.places = [_place(each, template.rows) for each, template in zip(sought, coarse, strict=True)]
        height = max(template.rows for template in coarse)
        # The number of rows per lane that a template may span, whichever lane it starts on.
        self._parts = 1 + -(-max(height - 1, 1) // LANES)
        self._runs = -(-max(place.count for place in self.places) // LANES)
        self.count = LANES * self._runs
        size = faces[0].shape[0] * faces[0].shape[1]
        needles, rows = len(sought), -(-self._parts * LANES // ROWS_AT_ONCE) * ROWS_AT_ONCE
        self._faces = np.zeros((needles, size, self._runs + self._parts - 1), np.float32)
        at_once = AT_ONCE // (2 * self._faces.size) or 1
        # By frame and needle: the gauge (later its square), and the gauge times its face.
        self._images = np.zeros((2, at_once, *self._faces.shape), np.float32)
        # For the gauge, and gauge times face: the weights and the needle. `_weights` are for the square of the gauge.
        self._kernels = np.zeros((2, 1, needles, 2, rows, size), np.float32)
        self._weights = np.zeros((needles, rows, size), np.float32)
        # Lanes are consecutive in the images, and so are their sums, with a few between them that are not scores.
        self._width = LANES * self._faces.shape[-1] - self._parts + 1
        # By field of `FaceMoments` and needle; a needle that shows nothing scores nothing.
        self._known = np.ones((6, needles, self._width), np.float32)
        for index, (template, face) in enumerate(zip(coarse, faces, strict=True)):
            self._prepare(index, template, face)

    def _prepare(self, index: int, template: NeedleTemplate, face: Floats) -> None:
        flat = face.reshape(-1, face.shape[-1])
        self._faces[index, :, : flat.shape[1]] = flat
        count = self.places[index].count
        rows = np.ascontiguousarray(collected(face)[: count + template.rows - 1])
        own = face_moments(rows, template)
        weights = template.trust / own.total[0]  # all pixels are visible, so it is the same on every row
        self._weights[index] = self._kernels[:, 0, index, 0] = self._by_lane(weights)
        self._kernels[0, 0, index, 1] = self._by_lane(weights * template.light)
        self._kernels[1, 0, index, 1] = self._by_lane(weights * (template.transparency - 1))
        known = np.zeros((len(self._known), self.count), np.float32)
        known[:, :count] = [getattr(own, field.name) for field in fields(own)]
        known[2, count:] = 1.0  # a divisor
        self._lanes(self._known)[:, index] = known.reshape(-1, self._runs, LANES).swapaxes(1, 2)

    def _by_lane(self, kernel: Floats) -> Floats:
        """Return a kernel (H, C) starting on each lane: (parts * lanes, lanes * C), padded with rows of zeros."""
        rows = np.zeros((LANES, self._parts * LANES, kernel.shape[1]), np.float32)
        for lane in range(LANES):
            rows[lane, lane : lane + len(kernel)] = kernel
        by_part = rows.reshape(LANES, self._parts, -1).swapaxes(0, 1)
        kernels = np.zeros(self._weights.shape[1:], np.float32)
        kernels[: self._parts * LANES] = by_part.reshape(self._parts * LANES, -1)
        return kernels

    def scores(self, gauges: Sequence[Floats]) -> Floats:
        """(F, K, N): as `Search.scores`."""
        frames, at_once = len(gauges[0]), self._images.shape[1]
        scores = np.empty((frames, len(self.places), self.count), np.float32)
        for first in range(0, frames, at_once):
            part = slice(first, first + at_once)
            self._search([gauge[part] for gauge in gauges], scores[part])
        return scores

    def _search(self, gauges: Sequence[Floats], scores: Floats) -> None:
        images = self._images[:, : len(scores)]
        for index, place in enumerate(self.places):
            gauge = gauges[place.gauge]
            images[0, :, index, :, : gauge.shape[-1]] = gauge.reshape(len(gauge), -1, gauge.shape[-1])
        np.multiply(images[0], self._faces, out=images[1])
        by_lane = scores.reshape(*scores.shape[:2], self._runs, LANES).swapaxes(2, 3)
        by_lane[:] = self._lanes(self._partial(images))

    def _partial(self, images: Floats) -> Floats:
        """Do `correlation.partial_normxcorr`: (F, K, width)."""
        size = images.shape[-2]
        both = self._kernels.reshape(*self._kernels.shape[:3], -1, size) @ images
        both = both.reshape(*both.shape[:3], 2, -1, images.shape[-1])
        mean, with_face = self._sums(both[..., 0, :, :])
        square = self._sums(self._weights @ np.square(images[0], out=images[0]))
        with_needle = self._sums(both[0, ..., 1, :, :] + both[1, ..., 1, :, :])
        return partial_ncc(FaceMoments(*self._known), mean, square, with_face, with_needle)

    def _sums(self, products: Floats) -> Floats:
        """Do `correlation.sliding_sums` from products of images with kernels made by `_by_lane`: (..., width)."""
        rows = products[..., : self._parts * LANES, :]
        by_part = rows.reshape(*rows.shape[:-2], self._parts, -1)
        first, second, *others = (by_part[..., part, part : part + self._width] for part in range(self._parts))
        sums: Floats = first + second
        for other in others:
            sums += other
        return sums

    def _lanes(self, sums: Floats) -> Floats:
        """Return a view (A, B, lanes, runs) on contiguous sums (A, B, width)."""
        *outer, number = sums.strides
        shape, strides = (*sums.shape[:2], LANES, self._runs), (*outer, number * self._faces.shape[-1], number)
        return np.ndarray(shape, sums.dtype, sums, strides=strides)


def _place(sought: SearchTarget, height: int) -> SearchedRows:
    axis, size = (sought.template.rows - 1) // 2, len(sought.face)
    rows = -(-size // COARSE_STEP)
    return SearchedRows(sought.gauge, axis, size - axis - 1, rows - height + 1, size)


def interleave_rows(gauge: NDArray[Any]) -> NDArray[Any]:
    """(lanes, C', M): every third column and row of an unwrapped gauge (R, C), row `m * LANES + lane` at [lane, :, m].

    Lanes that lack a last row repeat the gauge's.
    """
    thin = gauge[::COARSE_STEP, ::COARSE_STEP]
    whole = np.empty((-(-len(thin) // LANES), LANES, thin.shape[1]), gauge.dtype)
    rows = whole.reshape(-1, thin.shape[1])
    rows[: len(thin)] = thin
    rows[len(thin) :] = thin[-1]
    return whole.transpose(1, 2, 0)


def collected(dealt_out: NDArray[Any]) -> NDArray[Any]:
    """(lanes * M, C'): undo `interleave_rows`."""
    return dealt_out.transpose(2, 0, 1).reshape(-1, dealt_out.shape[1])


def thinned(template: NeedleTemplate) -> NeedleTemplate:
    """Return every third row and column of a template, including its axis."""
    skip = (template.rows - 1) // 2 % COARSE_STEP
    rows = slice(skip, template.rows - skip, COARSE_STEP)
    layers = {
        name: getattr(template, name)[rows, ::COARSE_STEP] for name in ("pixels", "light", "transparency", "trust")
    }
    return NeedleTemplate(**layers, step_deg=template.step_deg * COARSE_STEP)


def peaks_of(scores: Floats, where: Mask) -> tuple[Indices, Floats]:
    """Find the highest of scores (..., N) where the mask is true, and its parabola's peak: (...) each, as indices."""
    top = np.where(where, scores, -np.inf).argmax(axis=-1)
    around = limited(top[..., None] + np.array([-1, 0, 1]), 0, scores.shape[-1] - 1)
    before, here, after = np.moveaxis(np.take_along_axis(scores, around, axis=-1).astype(np.float64), -1, 0)
    bend = before - 2 * here + after
    off = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=np.isfinite(bend) & (bend < 0))
    return top, top + limited(off, -0.5, 0.5)
