"""Medians of small arrays and of many arrays, where NumPy's functions take several times as long."""

from __future__ import annotations

import numpy as np

from decoder.panel.arrays import Floats

# Standard deviation of normal noise per unit of its median absolute deviation.
MAD_TO_SIGMA = 1.4826


def median(values: Floats) -> Floats:
    """Take the median of values (N,) without NaN, identical to `np.median`.

    Many are parted once: NumPy takes eight times as long to part them at two neighbours.
    """
    lower, higher = (len(values) - 1) // 2, len(values) // 2
    parted = np.partition(values, higher)
    low = parted[lower] if lower == higher else parted[:higher].max()
    middle: Floats = (low + parted[higher]) / 2
    return middle


def median_of(views: Floats) -> Floats:
    """Take the median of each pixel over K views, (K, ...), as `np.median` on axis 0 does at three times the cost."""
    values = np.sort(views.reshape(len(views), -1).T.copy(), axis=1)
    low, high = values[:, (len(views) - 1) // 2], values[:, len(views) // 2]
    median: Floats = ((low + high) / 2).reshape(views.shape[1:])
    return median


def middle_views(views: Floats) -> tuple[Floats, Floats]:
    """Sort views (N, ...) pixel by pixel; return the one at (N - 1) // 2, and the next if there is one."""
    first = (len(views) - 1) // 2
    ordered = np.sort(views, axis=0)
    return ordered[first], ordered[min(first + 1, len(views) - 1)]
