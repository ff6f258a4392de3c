"""The windows of the quick reader: the pixels around each needle of many frames, and the least squares on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.plain_fit import PlainFitter
from decoder.quick_pixels import Pixels, QuickGrids
from decoder.quick_search import QuickNeedle


@dataclass(frozen=True, slots=True)
class WindowFits:
    """Of K needles in F frames, (F, K) each: the gauges' rows of their axes, the rest as in `quick_fit.Fits`."""

    row: Floats
    fraction: Floats
    sigma_rows: Floats
    score: Floats

    def put(self, frames: Indices, others: WindowFits) -> None:
        """What was found in some of the frames."""
        for name in ("row", "fraction", "sigma_rows", "score"):
            getattr(self, name)[frames] = getattr(others, name)


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

    def fits(self, frames: Sequence[Pixels], rows: Indices, places: Floats) -> WindowFits:
        """The least squares of K needles in F frames, (F, K) each, in windows around rows, the needles at `places`."""
        row = limited(rows, self._axis, self._last_row)
        top_rows = row - self._axis
        first = self._first + top_rows * self._columns
        guess_rows = limited(places - row, -0.5, 0.5)
        found = np.empty((4, *row.shape))
        for group, size, fitter in zip(self._groups, self._sizes, self._fitters, strict=True):
            windows = np.stack([frame.runs(own, size) for frame, own in zip(frames, first[:, group], strict=True)])
            fits = fitter.fit(windows, top_rows[:, group], guess_rows[:, group])
            for number, values in enumerate((fits.fraction, fits.sigma_rows, fits.score), 1):
                found[number][:, group] = values
        found[0] = row + found[1]
        return WindowFits(*found)
