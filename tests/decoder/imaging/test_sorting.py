"""Sorting and medians of our own: NumPy's, to the bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from decoder.imaging.sorting import median, middle_views
from decoder.panel.arrays import Floats

LEVELS = st.floats(-300, 300, width=32)


@given(st.integers(1, 50).flatmap(lambda count: arrays(np.float32, (count, 2, 3), elements=LEVELS | st.just(np.inf))))
def test_middle_views_are_those_of_sorted_pixels(views: Floats) -> None:
    """However many there are, and where some show nothing."""
    first = (len(views) - 1) // 2
    low, high = middle_views(views.copy())

    assert (low == np.sort(views, axis=0)[first]).all()
    assert (high == np.sort(views, axis=0)[min(first + 1, len(views) - 1)]).all()


@given(st.integers(1, 60).flatmap(lambda count: arrays(np.float32, count, elements=LEVELS)))
def test_the_middle_is_the_median(values: Floats) -> None:
    """Of odd and even numbers of values, in their own precision."""
    middle = median(values)

    assert middle == np.median(values)
    assert middle.dtype == np.float32
