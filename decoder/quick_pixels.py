"""The pixels that the quick reader asks for: of a frame, or of one that is unwrapped already.

Both number the samples of all its gauges through, gauge by gauge, row by row; so an index means the same place in
either.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from decoder.alignment import Alignment
from decoder.arrays import Floats, Indices
from decoder.pictures import GreyPicture
from decoder.resampling import PointMap, levels_at
from decoder.searching import dealt
from decoder.unwrapping import UnwrappedGauge, Unwrapper

# As many of a frame's pixels stay in the processor's cache until they are sampled.
AT_HAND_PX = 1 << 18

Levels = NDArray[Any]
"""Grey levels, whole ones where a frame is sampled."""


class Pixels(Protocol):
    """The samples of one frame."""

    searched: Levels
    """(S,) float32 or uint8: of each gauge what is searched, as `searching.dealt` has it."""

    def runs(self, first: Indices, size: int) -> Levels:
        """(len(first), size): from each of these numbers on so many samples."""
        ...


class QuickGrids:
    """The grids of some gauges; `gauges` are their places in the panel, whose gauges the unwrapper has."""

    def __init__(self, gauges: Sequence[int], unwrapper: Unwrapper) -> None:
        self.gauges = tuple(gauges)
        shapes = [(grid.rows, grid.columns) for grid in (unwrapper.grids[index] for index in gauges)]
        ends = np.cumsum([0, *(rows * columns for rows, columns in shapes)]).tolist()
        self.first = dict(zip(gauges, ends, strict=False))
        self._points = unwrapper.points(gauges)
        numbers = [
            np.arange(first, end).reshape(shape) for first, end, shape in zip(ends[:-1], ends[1:], shapes, strict=True)
        ]
        searched = [dealt(own) for own in numbers]
        self.searched_shapes = [own.shape for own in searched]
        self._map = PointMap.of([self._points[own.ravel()].T for own in searched])
        self._ends = _ends(self._map.folded.reshape(-1, 2), self._map.slices)

    @property
    def searched_parts(self) -> tuple[slice, ...]:
        """Where each gauge lies in `Pixels.searched`."""
        return self._map.slices

    def of_frame(self, frame: GreyPicture, alignment: Alignment) -> Pixels:
        """Of a frame, straight from its own pixels; those for the search at once, while the frame is at hand."""
        places = self._map.places(alignment)
        for left, top, right, bottom in places.reshape(-1)[self._ends].astype(np.intp).tolist():
            # Points around a dial lie scattered in memory, each to be waited for: row by row the processor reads ahead.
            frame[top : bottom + 2, left : right + 2].copy()
        searched = levels_at(frame, places)[: self._map.slices[-1].stop]
        return _FramePixels(self._points, frame, alignment, searched)

    def of_unwrapped(self, gauges: Sequence[UnwrappedGauge]) -> Pixels:
        """Of all unwrapped gauges of the panel."""
        return _UnwrappedPixels([gauges[index] for index in self.gauges], list(self.first.values()))


class _FramePixels:
    def __init__(self, points: Floats, frame: GreyPicture, alignment: Alignment, searched: Levels) -> None:
        self._points, self._frame, self._alignment = points, frame, alignment
        self.searched = searched

    def runs(self, first: Indices, size: int) -> Levels:
        places = self._alignment.places(_runs(self._points, size)[first])
        return levels_at(self._frame, places).reshape(-1, size)


class _UnwrappedPixels:
    """`first` are the numbers of the gauges' first samples."""

    def __init__(self, gauges: Sequence[UnwrappedGauge], first: Sequence[int]) -> None:
        self._gauges, self._first = [gauge.ravel() for gauge in gauges], first
        self.searched = np.concatenate([dealt(gauge).ravel() for gauge in gauges])

    def runs(self, first: Indices, size: int) -> Levels:
        runs = np.empty((len(first), size), np.float32)
        for run, number in zip(runs, first.tolist(), strict=True):
            index = bisect_right(self._first, number) - 1
            start = number - self._first[index]
            run[:] = self._gauges[index][start : start + size]
        return runs


def _ends(points: Floats, parts: Sequence[slice]) -> Indices:
    """(N, 4): of boxes around points (M, 2), which of their numbers are the left, top, right and bottom ends.

    Parts side by side share a box; there are none where they hold more pixels than stay at hand.
    """
    boxes: list[Indices] = []
    for part in sorted(parts, key=lambda part: float(points[part, 1].min())):
        own = np.arange(part.start, part.stop)
        if boxes and points[own, 1].min() <= points[boxes[-1], 1].max():
            boxes[-1] = np.concatenate([boxes[-1], own])
        else:
            boxes.append(own)
    first = [own[points[own].argmin(axis=0)] for own in boxes]
    last = [own[points[own].argmax(axis=0)] for own in boxes]
    ends = 2 * np.hstack([first, last]) + [0, 1, 0, 1]
    left, top, right, bottom = points.reshape(-1)[ends].T
    return ends if ((right - left) * (bottom - top)).sum() <= AT_HAND_PX else ends[:0]


def _runs(values: Levels, size: int) -> Levels:
    """(N - size + 1, size, ...): a view on (N, ...) that shows for each of them the next so many."""
    stride, *others = values.strides
    shape = (len(values) - size + 1, size, *values.shape[1:])
    return np.ndarray(shape, values.dtype, values, strides=(stride, stride, *others))
