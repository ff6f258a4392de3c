"""Sampling: grey levels of a panel's unwrapped gauges, straight from a frame's pixels, on demand.

The samples of all gauges are numbered consecutively, gauge by gauge, row by row; so a number means the same place in
every frame. The searched samples of gauges are taken at once, the rest when a window needs them. Gauges that are not
searched are sampled whole, all together when the first is needed.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment
from decoder.imaging.pictures import Coloured, GreyPicture
from decoder.imaging.resampling import PointMap, levels_at
from decoder.imaging.unwrapping import UnwrappedGauge, Unwrapper
from decoder.instruments.reading import Reading, Readings
from decoder.instruments.thresholds import AT_HAND_PX
from decoder.matching.needle_search import interleave_rows
from decoder.panel.arrays import Floats, Indices

Levels = NDArray[Any]
"""Grey levels, whole ones where a frame is sampled."""
Part = tuple[slice, slice]
"""Rows and columns of an unwrapped gauge."""
ALL: Part = (slice(None), slice(None))


class Samples(Protocol):
    """The samples of one frame."""

    searched: Levels
    """(S,) float32 or uint8: of each gauge what is searched, as `searching.interleave_rows` has it."""

    def runs(self, first: Indices, size: int) -> Levels:
        """(len(first), size): runs of samples starting at these numbers."""
        ...

    def strip(self, first: int, shape: tuple[int, int], part: Part) -> Levels:
        """(R', C'): part of a gauge of this shape, by the number of its first sample."""
        ...


class GaugeSampler:
    """Samples the gauges of one panel; `searched` are the indexes of those that are searched.

    `parts` are the rows and columns of a gauge's strip, by index, if it is not the whole gauge.

    Attributes
    ----------
    first
        Number of the first sample by gauge.
    shapes
        Rows and columns by gauge.
    """

    def __init__(
        self, unwrapper: Unwrapper, searched: Sequence[int], parts: Mapping[int, Part] = MappingProxyType({})
    ) -> None:
        self._unwrapper, self._parts = unwrapper, parts
        self.searched = tuple(searched)
        self.shapes = [(grid.rows, grid.columns) for grid in unwrapper.grids]
        self.first: list[int] = np.cumsum([0, *(rows * columns for rows, columns in self.shapes)]).tolist()
        self._is_flat = all(grid.raised is None for grid in unwrapper.grids)
        numbers = [self._searched_numbers(index) for index in self.searched]
        self.searched_shapes = [own.shape for own in numbers]
        ends = np.cumsum([0, *(own.size for own in numbers)]).tolist()
        self.searched_parts = [slice(first, end) for first, end in pairwise(ends)]

    def _searched_numbers(self, index: int) -> Indices:
        """List the numbers of a gauge's searched samples, in the order of `Samples.searched`."""
        return interleave_rows(np.arange(self.first[index], self.first[index + 1]).reshape(self.shapes[index]))

    def of_frame(self, frame: GreyPicture, alignment: Alignment, in_colour: Coloured | None = None) -> Samples:
        """Sample a frame at the panel's place in it; needles raised above their dials shift with the camera."""
        if not self._is_flat:
            return self.of_unwrapped(self._unwrapper.unwrap(frame, alignment, in_colour))
        plain = self._of_luma(frame, alignment)
        if in_colour is None or not self._unwrapper.mixed:
            return plain
        mixed = {
            index: _FrameSamples(self._points, part.pixels, alignment, plain.searched, origin=part.origin)
            for index, part in self._unwrapper.mixed_parts(in_colour(), alignment).items()
        }
        for place, index in enumerate(self.searched):
            if index in mixed:
                plain.searched[self.searched_parts[place]] = mixed[index].at(self._mixed_maps[index])
        return _MixedSamples(self.first, plain, mixed)

    def _of_luma(self, frame: GreyPicture, alignment: Alignment) -> _FrameSamples:
        if not self.searched:
            return _FrameSamples(self._points, frame, alignment, np.empty(0, np.uint8), self._whole)
        places = self._map.places(alignment)
        for left, top, right, bottom in places.reshape(-1)[self._ends].astype(np.intp).tolist():
            # A dial's points are scattered in memory, each a cache miss: row by row the processor prefetches.
            frame[top : bottom + 2, left : right + 2].copy()
        searched = levels_at(frame, places)[: self._map.slices[-1].stop]
        return _FrameSamples(self._points, frame, alignment, searched, self._whole)

    def of_unwrapped(self, gauges: Sequence[UnwrappedGauge]) -> Samples:
        """Take all samples from a frame's unwrapped gauges, in the panel's order."""
        return _UnwrappedSamples(gauges, self.first, self.searched)

    def strips(self, frames: Sequence[Samples], index: int) -> Floats:
        """Unwrap one gauge, or its part, from frames: (F, R, C) float32."""
        first, shape, part = self.first[index], self.shapes[index], self._parts.get(index, ALL)
        return np.stack([frame.strip(first, shape, part) for frame in frames], dtype=np.float32)

    @cached_property
    def _points(self) -> Floats:
        return self._unwrapper.points(range(len(self.shapes)))

    @cached_property
    def _map(self) -> PointMap:
        return PointMap.of([self._points[self._searched_numbers(index).ravel()].T for index in self.searched])

    @cached_property
    def _whole(self) -> _WholeGauges | None:
        """The gauges that are not searched, if there are any."""
        numbers = {
            first: np.arange(first, end).reshape(self.shapes[index])[self._parts.get(index, ALL)]
            for index, (first, end) in enumerate(pairwise(self.first))
            if index not in self.searched
        }
        if not numbers:
            return None
        points = PointMap.of([self._points[its.ravel()].T for its in numbers.values()])
        where = zip(points.slices, (its.shape for its in numbers.values()), strict=True)
        return _WholeGauges(points, dict(zip(numbers, where, strict=True)))

    @cached_property
    def _mixed_maps(self) -> dict[int, PointMap]:
        """The searched points by gauge that is not sampled in luma."""
        numbers = {index: self._searched_numbers(index) for index in self.searched if index in self._unwrapper.mixed}
        return {index: PointMap.of([self._points[its.ravel()].T]) for index, its in numbers.items()}

    @cached_property
    def _ends(self) -> Indices:
        return _ends(self._map.folded.reshape(-1, 2), self._map.slices)


@dataclass(frozen=True, slots=True)
class _WholeGauges:
    """Gauges sampled together: their points, and each gauge's slice and shape by the number of its first sample."""

    points: PointMap
    gauges: Mapping[int, tuple[slice, tuple[int, ...]]]


class _FrameSamples:
    """Samples of a frame, or of a part of it that begins at the pixel `origin`."""

    def __init__(
        self,
        points: Floats,
        frame: GreyPicture,
        alignment: Alignment,
        searched: Levels,
        whole: _WholeGauges | None = None,
        *,
        origin: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._points, self._frame, self._alignment = points, frame, alignment
        self.searched, self._whole = searched, whole
        self._origin = origin

    def at(self, points: PointMap) -> Levels:
        """(N,): sample the frame at other points of the panel."""
        return levels_at(self._frame, points.places(self._alignment, self._origin))[: points.slices[-1].stop]

    def runs(self, first: Indices, size: int) -> Levels:
        places = self._alignment.places(_runs(self._points, size)[first], self._origin)
        return levels_at(self._frame, places).reshape(-1, size)

    def strip(self, first: int, shape: tuple[int, int], part: Part) -> Levels:
        if self._whole is not None and first in self._whole.gauges:
            which, own_shape = self._whole.gauges[first]
            return self._whole_levels[which].reshape(own_shape)
        rows, columns = shape
        points = self._points[first : first + rows * columns].reshape(rows, columns, 2)[part]
        return levels_at(self._frame, self._alignment.places(points, self._origin)).reshape(points.shape[:2])

    @cached_property
    def _whole_levels(self) -> Levels:
        return np.empty(0, np.uint8) if self._whole is None else self.at(self._whole.points)


class _MixedSamples:
    """Samples of a frame with some gauges in their own mixture of colours; `first` as in `GaugeSampler`."""

    def __init__(self, first: Sequence[int], plain: _FrameSamples, mixed: Mapping[int, _FrameSamples]) -> None:
        self._first, self._plain, self._mixed = first, plain, mixed
        self.searched = plain.searched

    def runs(self, first: Indices, size: int) -> Levels:
        runs = self._plain.runs(first, size)
        gauges = np.searchsorted(self._first, first, "right") - 1
        for index, samples in self._mixed.items():
            its = gauges == index
            if its.any():
                runs[its] = samples.runs(first[its], size)
        return runs

    def strip(self, first: int, shape: tuple[int, int], part: Part) -> Levels:
        return self._mixed.get(self._first.index(first), self._plain).strip(first, shape, part)


class _UnwrappedSamples:
    """Samples of unwrapped gauges; `first` are the numbers of their first samples."""

    def __init__(self, gauges: Sequence[UnwrappedGauge], first: Sequence[int], searched: Sequence[int]) -> None:
        self._gauges, self._first = [gauge.ravel() for gauge in gauges], first
        parts = [interleave_rows(gauges[index]).ravel() for index in searched]
        self.searched = np.concatenate(parts) if parts else np.empty(0, np.float32)

    def runs(self, first: Indices, size: int) -> Levels:
        runs = np.empty((len(first), size), np.float32)
        for run, number in zip(runs, first.tolist(), strict=True):
            index = bisect_right(self._first, number) - 1
            start = number - self._first[index]
            run[:] = self._gauges[index][start : start + size]
        return runs

    def strip(self, first: int, shape: tuple[int, int], part: Part) -> Levels:
        return self._gauges[self._first.index(first)].reshape(shape)[part]


def _ends(points: Floats, parts: Sequence[slice]) -> Indices:
    """(N, 4): indexes, among the coordinates of points (M, 2), of the left, top, right and bottom ends of boxes.

    Parts side by side share a box; there are no boxes if they hold more pixels than fit the cache.
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
    """(N - size + 1, size, ...): a view of all runs of (N, ...)."""
    stride, *others = values.strides
    shape = (len(values) - size + 1, size, *values.shape[1:])
    return np.ndarray(shape, values.dtype, values, strides=(stride, stride, *others))


class Reader(Protocol):
    """Reads all instruments of one kind on a panel, in many frames at once."""

    def read(self, frames: Sequence[Samples], place_sigmas_deg: Floats) -> Readings:
        """Read F frames; `place_sigmas_deg` (F, gauges) is the angles' uncertainty due to the dials' positions."""
        ...


SeenGauge = tuple[UnwrappedGauge, Mapping[str, Reading], tuple[float, float]]
"""A gauge in one frame, unwrapped; what was read of it, and how far its dial lies from where anchors have it, px."""
