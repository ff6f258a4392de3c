"""The windows of the quick reader: the pixels around each needle of many frames, and the least squares on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from decoder.arrays import Floats, Indices
from decoder.quick_fit import QuickFitter
from decoder.quick_pixels import Pixels, QuickGrids
from decoder.quick_search import Peaks, QuickNeedle


@dataclass(frozen=True, slots=True)
class WindowFits:
    """Of K needles in F frames, (F, K) each: as in `quick_fit.Fits`."""

    fraction: Floats
    sigma_rows: Floats
    score: Floats


class Windows:
    """The windows of K needles; templates of one shape are fitted together."""

    def __init__(self, needles: Sequence[QuickNeedle], grids: QuickGrids) -> None:
        faces = {needle.gauge_index: needle.face.ravel() for needle in needles}
        self._faces = np.concatenate([faces[index] for index in grids.gauges])
        self._columns = np.array([needle.grid.columns for needle in needles])
        self._first = np.array([grids.first[needle.gauge_index] for needle in needles])
        self._axis = np.array([needle.axis for needle in needles])
        self._last_row = np.array([needle.grid.rows for needle in needles]) - self._axis - 1
        shapes = [needle.template.pixels.shape for needle in needles]
        self._groups = [
            np.array([index for index, shape in enumerate(shapes) if shape == own]) for own in dict.fromkeys(shapes)
        ]
        self._fitters = [
            QuickFitter(
                [needles[index].template for index in group], [needles[index].grid.pixels_per_sample for index in group]
            )
            for group in self._groups
        ]
        sizes = [int(np.prod(shapes[group[0]])) for group in self._groups]
        self._owner = np.concatenate([np.repeat(group, size) for group, size in zip(self._groups, sizes, strict=True)])
        self._offset = np.concatenate(
            [np.tile(np.arange(size), len(group)) for group, size in zip(self._groups, sizes, strict=True)]
        )
        parts = np.cumsum([0, *(len(group) * size for group, size in zip(self._groups, sizes, strict=True))])
        self._parts = [slice(first, end) for first, end in pairwise(parts.tolist())]

    def fits(self, frames: Sequence[Pixels], peaks: Peaks) -> WindowFits:
        """The least squares of K needles in F frames, (F, K) each, in windows around the peaks' rows."""
        row = np.clip(peaks.row, self._axis, self._last_row)
        first = self._first + (row - self._axis) * self._columns
        index = first[:, self._owner] + self._offset
        windows = np.stack([frame.at(own) for frame, own in zip(frames, index, strict=True)])
        faces = self._faces[index]
        guess_rows = np.clip(peaks.place - row, -0.5, 0.5)
        found = np.empty((3, *row.shape))
        for group, fitter, part in zip(self._groups, self._fitters, self._parts, strict=True):
            needles: Indices = np.tile(np.arange(len(group)), len(frames))
            fits = fitter.fit(
                needles,
                windows[:, part].reshape(len(needles), -1),
                faces[:, part].reshape(len(needles), -1),
                guess_rows[:, group].ravel(),
            )
            for number, values in enumerate((fits.fraction, fits.sigma_rows, fits.score)):
                found[number][:, group] = values.reshape(len(frames), len(group))
        return WindowFits(*found)
