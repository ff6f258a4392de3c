"""The grid of a gauge: which angles and radii its unwrapped form covers, and on which rows its needles may point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Indices, Mask
from decoder.dial_plane import DialPlane
from decoder.faces import needle_pixels
from decoder.gauge import Gauge
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.unwrapping import PolarGrid, polar_grid

# A needle may stand a little beyond the last mark, or beyond the stop that is behind it.
BEYOND_SWEEP_DEG = 4.0
# A dial that is read all the way round is unwrapped with so much of it twice that a peak at either end is whole.
OVERLAP_DEG = 2.0
# What a cropped template covers if the panel does not say.
PICTURE_SPAN_DEG = 16.0


def gauge_grid(gauge: Gauge, plane: DialPlane | None = None) -> PolarGrid:
    """The unwrapped gauge's sample points: where needles go, and as much beyond as the widest template needs.

    All round, two needles near each other are to lie side by side on it wherever one of them is.
    """
    if gauge.card is not None:
        return polar_grid(gauge.centre, gauge.radius, *gauge.sweep, plane=plane)
    widest_deg = max(needle.template.span or PICTURE_SPAN_DEG for needle in gauge.needles)
    margin_deg = _beyond_deg(gauge) + widest_deg / 2 + 1.0
    if gauge.is_round and len(gauge.needles) > 1:
        margin_deg += widest_deg
    first_deg, last_deg = gauge.reach
    first_deg, last_deg = first_deg - margin_deg, last_deg + margin_deg
    return polar_grid(gauge.centre, gauge.radius, first_deg, last_deg, across=gauge.tail, plane=plane)


def card_rows(grid: PolarGrid) -> int:
    """How many rows of a card's grid are one turn: all but the last, which is the first again."""
    return grid.rows - 1


def rows_in_sweep(gauge: Gauge, grid: PolarGrid) -> NDArray[np.bool_]:
    """(R,): the rows on which a needle's axis may lie."""
    angles_deg = grid.angle_deg(0) + grid.step_deg * np.arange(grid.rows)
    beyond_deg = _beyond_deg(gauge)
    first_deg, last_deg = gauge.reach
    return (angles_deg >= first_deg - beyond_deg) & (angles_deg <= last_deg + beyond_deg)


def row_of_angle(grid: PolarGrid, angle_deg: float) -> float:
    """The row of an angle on the grid, whole turns added or taken off: the one nearest to the grid's middle."""
    middle = (grid.rows - 1) / 2
    turn_rows = FULL_CIRCLE_DEG / grid.step_deg
    off = (angle_deg - grid.start_deg) / grid.step_deg - middle
    return middle + off - turn_rows * round(off / turn_rows)


def turn_rows(gauge: Gauge, grid: PolarGrid) -> float | None:
    """How many rows a full turn has where the dial is read all the way round."""
    return FULL_CIRCLE_DEG / grid.step_deg if gauge.is_round else None


def same_rows(row: float, turn: float | None) -> tuple[float, ...]:
    """All rows at which what lies on one row shows again, on the grid or beyond it."""
    return (row,) if turn is None else (row - turn, row, row + turn)


def opposite_rows(row: float, grid: PolarGrid) -> tuple[float, ...]:
    """The rows at which what lies on one row shows with its columns the other way round; none without tails."""
    half = FULL_CIRCLE_DEG / grid.step_deg / 2
    return (row - 3 * half, row - half, row + half, row + 3 * half) if grid.tail_columns else ()


def needle_places(grid: PolarGrid, touched: Mask, axis_row: float, turn: float | None) -> Mask:
    """(R, C): all pixels of the grid that a needle with its axis on a row touches; `touched` (H, C) of its template."""
    place = np.zeros((grid.rows, grid.columns), bool)
    place.reshape(-1)[touched_pixels(grid, touched, axis_row, turn)] = True
    return place


def touched_pixels(grid: PolarGrid, touched: Mask, axis_row: float, turn: float | None) -> Indices:
    """(N,): the same pixels, numbered through; some may be there twice."""
    shape = (grid.rows, grid.columns)
    return np.concatenate(
        [needle_pixels(shape, touched, row) for row in same_rows(axis_row, turn)]
        + [needle_pixels(shape, touched[:, ::-1], row) for row in opposite_rows(axis_row, grid)]
    )


def _beyond_deg(gauge: Gauge) -> float:
    if gauge.is_round:
        return OVERLAP_DEG
    first_deg, last_deg = gauge.reach
    return min(BEYOND_SWEEP_DEG, (FULL_CIRCLE_DEG - (last_deg - first_deg)) / 2)
