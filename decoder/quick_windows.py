"""The windows of the quick reader: the pixels around each needle of many frames, and the least squares on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, limited
from decoder.plain_fit import PlainFitter
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
        self._columns = np.array([needle.grid.columns for needle in needles])
        self._first = np.array([grids.first[needle.gauge_index] for needle in needles])
        self._axis = np.array([needle.axis for needle in needles])
        self._last_row = np.array([needle.grid.rows for needle in needles]) - self._axis - 1
        shapes = [needle.template.pixels.shape for needle in needles]
        self._groups = [
            np.array([index for index, shape in enumerate(shapes) if shape == own]) for own in dict.fromkeys(shapes)
        ]
        self._sizes = [int(np.prod(shape)) for shape in dict.fromkeys(shapes)]
        self._fitters = [
            PlainFitter(
                [needles[index].template for index in group],
                [needles[index].face for index in group],
                [needles[index].grid.pixels_per_sample for index in group],
            )
            for group in self._groups
        ]

    def fits(self, frames: Sequence[Pixels], peaks: Peaks) -> WindowFits:
        """The least squares of K needles in F frames, (F, K) each, in windows around the peaks' rows."""
        row = limited(peaks.row, self._axis, self._last_row)
        top_rows = row - self._axis
        first = self._first + top_rows * self._columns
        guess_rows = limited(peaks.place - row, -0.5, 0.5)
        found = np.empty((3, *row.shape))
        for group, size, fitter in zip(self._groups, self._sizes, self._fitters, strict=True):
            windows = np.stack([frame.runs(own, size) for frame, own in zip(frames, first[:, group], strict=True)])
            fits = fitter.fit(windows, top_rows[:, group], guess_rows[:, group])
            for number, values in enumerate((fits.fraction, fits.sigma_rows, fits.score)):
                found[number][:, group] = values
        return WindowFits(*found)
