"""Unwrapping: what is known at every point is known in polar coordinates too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.alignment import IDENTITY, Alignment
from decoder.pictures import GreyPicture
from decoder.resampling import all_inside, as_places, each_inside, inside
from decoder.unwrapping import PolarGrid, Unwrapper, polar_grid, rows_at, rows_of_each

CENTRE = (60.25, 50.75)
ANGLES = st.floats(-400.0, 800.0)


def ramp(slope_x: int, slope_y: int) -> GreyPicture:
    """A picture whose grey level is a linear function of the place, exactly."""
    y, x = np.mgrid[0:100, 0:120]
    return (slope_x * x + slope_y * y).astype(np.uint8)


def expected_ramp(grid: PolarGrid, alignment: Alignment, slope_x: int, slope_y: int) -> np.ndarray:
    """The ramp at the grid's points, by the formulas of the module's docstring alone."""
    angle = np.radians(grid.start_deg + grid.step_deg * np.arange(grid.rows))[:, None]
    radius = grid.inner_px + grid.column_px * np.arange(grid.columns)[None, :]
    x, y = grid.centre[0] + radius * np.cos(angle), grid.centre[1] + radius * np.sin(angle)
    cos, sin = math.cos(math.radians(alignment.roll_deg)), math.sin(math.radians(alignment.roll_deg))
    frame_x = cos * x - sin * y + alignment.matrix[0, 2]
    frame_y = sin * x + cos * y + alignment.matrix[1, 2]
    return slope_x * frame_x + slope_y * frame_y


@pytest.mark.parametrize(("slope_x", "slope_y"), [(2, 0), (0, 2), (1, 1)])
@pytest.mark.parametrize(
    "alignment", [IDENTITY, Alignment.rigid(3.0, (2.4, -5.6), 1.0)], ids=["as is", "shifted and rolled"]
)
def test_linear_ramp_is_unwrapped_to_its_formula(slope_x: int, slope_y: int, alignment: Alignment) -> None:
    """On a linear picture bilinear sampling is exact, so every sample equals the formula to rounding."""
    grid = polar_grid(CENTRE, (5.0, 40.0), 110.0, 430.0)
    (unwrapped,) = Unwrapper([grid]).unwrap(ramp(slope_x, slope_y), alignment)

    assert unwrapped.dtype == np.float32
    assert np.abs(unwrapped - expected_ramp(grid, alignment, slope_x, slope_y)).max() <= 0.6


def test_several_gauges_are_unwrapped_at_once_each_as_if_alone() -> None:
    """Gauges of different sizes in one resampling do not touch each other."""
    picture = np.random.default_rng(21).integers(0, 255, (100, 120)).astype(np.uint8)
    grids = [polar_grid(CENTRE, (5.0, 40.0), 0.0, 300.0), polar_grid((30.0, 30.0), (3.0, 17.0), 120.0, 420.0)]

    together = Unwrapper(grids).unwrap(picture, IDENTITY)

    assert [part.shape for part in together] == [(grid.rows, grid.columns) for grid in grids]
    for grid, part in zip(grids, together, strict=True):
        assert np.array_equal(part, Unwrapper([grid]).unwrap(picture, IDENTITY)[0])


def test_turning_about_the_centre_only_shifts_rows() -> None:
    """A camera that rolls about a dial's centre moves its unwrapped form by whole rows."""
    y, x = np.mgrid[0:100, 0:120].astype(float)
    wheel = 120 + 60 * np.cos(3 * np.arctan2(y - CENTRE[1], x - CENTRE[0]))
    grid = polar_grid(CENTRE, (20.0, 40.0), 0.0, 300.0)
    unwrapper = Unwrapper([grid])
    rolled = Alignment.pinned(CENTRE, CENTRE, 20.0, 1.0)

    (still,), (turned,) = (unwrapper.unwrap(wheel.astype(np.uint8), each) for each in (IDENTITY, rolled))

    shift = round(20.0 / grid.step_deg)
    assert np.abs(turned[:-shift] - still[shift:]).max() <= 1.0


def test_samples_outside_the_frame_repeat_its_border() -> None:
    """Beyond the frame there is its last pixel, and `inside` says that there is a beyond."""
    grid = polar_grid((5.0, 50.0), (10.0, 20.0), 170.0, 190.0)
    (unwrapped,) = Unwrapper([grid]).unwrap(ramp(2, 0), IDENTITY)

    assert unwrapped.tolist() == np.zeros_like(unwrapped).tolist()
    assert not inside(grid.rim(), IDENTITY, 120, 100)


@pytest.mark.parametrize(
    ("shift", "expected"), [((0.0, 0.0), True), ((-20.2, 0.0), True), ((-20.3, 0.0), False), ((18.8, 0.0), False)]
)
def test_inside_counts_the_outermost_pixel_centres(shift: tuple[float, float], *, expected: bool) -> None:
    """A gauge is inside as long as all samples lie between the centres of the first and the last pixels."""
    grid = polar_grid(CENTRE, (5.0, 40.0), 0.0, 360.0)

    assert inside(grid.rim(), Alignment.rigid(0.0, shift, 1.0), 120, 100) is expected


@given(angle_deg=ANGLES, rows=st.integers(1, 40))
def test_window_around_an_angle_has_it_in_the_middle(angle_deg: float, rows: int) -> None:
    """The grid around an angle is of the same dial, with that angle in its middle row."""
    grid = polar_grid(CENTRE, (5.0, 40.0), 110.0, 430.0)
    window = grid.at(angle_deg, 2 * rows + 1)

    assert window.angle_deg(rows) == pytest.approx(angle_deg, abs=1e-9)
    assert (window.rows, window.columns, window.step_deg) == (2 * rows + 1, grid.columns, grid.step_deg)


@given(start_deg=ANGLES, sweep_deg=st.floats(10.0, 360.0), inner=st.floats(1.0, 60.0), depth=st.floats(2.0, 300.0))
def test_grid_covers_sweep_and_radius(start_deg: float, sweep_deg: float, inner: float, depth: float) -> None:
    """The first row and column lie on the start, the last on the end, to half a step."""
    grid = polar_grid(CENTRE, (inner, inner + depth), start_deg, start_deg + sweep_deg)

    assert grid.angle_deg(0) == start_deg
    assert grid.angle_deg(grid.rows - 1) == pytest.approx(start_deg + sweep_deg, abs=grid.step_deg / 2 + 1e-9)
    assert grid.inner_px + grid.column_px * (grid.columns - 1) == pytest.approx(inner + depth)
    assert 0 < grid.pixels_per_sample <= 1


@given(offset=st.floats(0.0, 0.999), slope=st.floats(-5.0, 5.0), bend=st.floats(-0.5, 0.5))
def test_fractional_rows_of_a_parabola_are_exact(offset: float, slope: float, bend: float) -> None:
    """Cubic interpolation between rows reproduces a parabola."""
    rows = np.arange(20.0)
    strip = np.repeat((slope * rows + bend * rows**2)[:, None], 3, axis=1).astype(np.float32)
    wanted = np.array([4.0, 9.0]) + offset

    expected = np.repeat((slope * wanted + bend * wanted**2)[:, None], 3, axis=1)

    assert rows_at(strip, wanted) == pytest.approx(expected, abs=1e-3)


def test_rows_beyond_the_ends_are_the_end_rows() -> None:
    """A window that reaches beyond an unwrapped gauge repeats its first and last rows."""
    strip = np.array([[1.0], [2.0], [3.0]], np.float32)

    assert rows_at(strip, np.array([-5.0, 0.0, 2.0, 9.0])).ravel().tolist() == [1.0, 1.0, 3.0, 3.0]


@given(first=st.floats(-3.0, 22.0), count=st.integers(1, 12))
def test_rows_that_follow_each_other_are_as_each_by_itself(first: float, count: int) -> None:
    """Wherever they begin, also beyond the ends, and on whole rows."""
    strip = np.random.default_rng(71).uniform(0, 255, (20, 5)).astype(np.float32)
    rows = first + np.arange(count)

    together = rows_at(strip, rows)

    alone = np.concatenate([rows_at(strip, row[None]) for row in rows])
    assert np.allclose(together, alone, atol=1e-3)
    assert not np.shares_memory(together, strip)


@given(axis_rows=st.lists(st.floats(-2.0, 40.0), min_size=1, max_size=6), count=st.integers(1, 9))
def test_rows_of_each_gauge_are_as_of_it_alone(axis_rows: list[float], count: int) -> None:
    """To the bit, within the gauge and beyond its ends."""
    strips = list(np.random.default_rng(5).integers(0, 256, (len(axis_rows), 40, 3)).astype(np.float32))
    rows = np.array(axis_rows)[:, None] + np.arange(count) - (count - 1) / 2

    together = rows_of_each(strips, rows)

    assert (together == np.stack([rows_at(strip, own) for strip, own in zip(strips, rows, strict=True)])).all()


@given(shift=st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0)), roll_deg=st.floats(-40.0, 40.0))
def test_many_alignments_keep_inside_what_one_does(shift: tuple[float, float], roll_deg: float) -> None:
    """Whether points lie in the frame, of many alignments at once: those on its last pixels aside."""
    points = as_places(np.array([[100.0, 200.0, 150.0], [80.0, 90.0, 160.0]]))
    there = Alignment.rigid(roll_deg, shift, 1.0)

    if all_inside(points, there, 319, 239) or not all_inside(points, there, 321, 241):
        assert each_inside(points, [IDENTITY, there], 320, 240) == [True, all_inside(points, there, 320, 240)]
    assert each_inside(points, [], 320, 240) == []
