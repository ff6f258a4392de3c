"""The pixels that a needle leaves, looked up in blocks: those that neither row it lies between has it touch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.uncovered_pixels import UncoveredPixels

HEIGHT, COLUMNS = 5, 7
TOUCHED = np.random.default_rng(3).random((HEIGHT, COLUMNS)) < 0.5


@given(
    first_rows=st.lists(st.integers(-60, 60), min_size=1, max_size=4),
    needle_row=st.one_of(st.floats(-60.0, 60.0), st.integers(-60, 60).map(float)),
    rows=st.integers(1, 12),
)
@pytest.mark.parametrize("step", [1, 3])
def test_a_pixel_is_left_where_the_needle_touches_it_from_neither_row(
    step: int, first_rows: list[int], needle_row: float, rows: int
) -> None:
    """On whole rows and between them, within the needle's reach and beyond it."""
    needle_rows = np.full(len(first_rows), needle_row)
    found = UncoveredPixels(TOUCHED, rows, step).at(np.array(first_rows), needle_rows)
    touched = {(row, column) for row, column in np.argwhere(TOUCHED).tolist()}
    tops = {int(np.floor(needle_row)), int(np.ceil(needle_row))}
    expected = [
        [
            [
                all((first + step * row - top, column) not in touched for top in tops)
                for column in range(0, COLUMNS, step)
            ]
            for row in range(rows)
        ]
        for first in first_rows
    ]
    np.testing.assert_array_equal(found, np.array(expected, np.float32))
