"""Sorting and medians of our own: NumPy's, to the bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from decoder.arrays import Floats
from decoder.sorting import median_of, middle_level, middle_of, sorted_views

LEVELS = st.floats(-300, 300, width=32)


@given(st.integers(1, 50).flatmap(lambda count: arrays(np.float32, (count, 2, 3), elements=LEVELS | st.just(np.inf))))
def test_views_are_sorted_pixel_by_pixel(views: Floats) -> None:
    """However many there are, and where some show nothing."""
    assert (sorted_views(views.copy()) == np.sort(views, axis=0)).all()


@given(st.integers(1, 60).flatmap(lambda count: arrays(np.float32, count, elements=LEVELS)))
def test_the_middle_is_the_median(values: Floats) -> None:
    """Of odd and even numbers of values, in their own precision."""
    middle = middle_of(values)

    assert middle == np.median(values)
    assert middle.dtype == np.float32


@given(st.integers(1, 60).flatmap(lambda count: arrays(np.float32, count, elements=LEVELS)))
def test_the_middle_level_is_the_median(levels: Floats) -> None:
    """Whether all of them are whole or not."""
    for own in (levels, np.round(levels)):
        assert middle_level(own) == np.median(own)


@given(st.integers(1, 20).flatmap(lambda count: arrays(np.float32, (count, 2, 3), elements=LEVELS)))
def test_the_median_of_views_is_that_of_each_pixel(views: Floats) -> None:
    """Of odd and even numbers of views."""
    assert (median_of(views) == np.median(views, axis=0)).all()
