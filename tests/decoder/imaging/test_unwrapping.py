"""Unwrapping: a picture known at every point is known in polar coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.resampling import inside
from decoder.imaging.unwrapping import PolarGrid, Unwrapper, polar_grid

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


@pytest.mark.parametrize(("slope_x", "slope_y"), [(2, 0), (0, 2)])
@pytest.mark.parametrize(
    "alignment", [IDENTITY, Alignment.rigid(3.0, (2.4, -5.6), 1.0)], ids=["as is", "shifted and rolled"]
)
def test_linear_ramp_is_unwrapped_to_its_formula(slope_x: int, slope_y: int, alignment: Alignment) -> None:
    """On a linear picture bilinear sampling is exact, so every sample equals the formula to rounding."""
    grid = polar_grid(CENTRE, (5.0, 40.0), 110.0, 430.0)
    (unwrapped,) = Unwrapper([grid]).unwrap(ramp(slope_x, slope_y), alignment)

    assert unwrapped.dtype == np.float32
    assert np.abs(unwrapped - expected_ramp(grid, alignment, slope_x, slope_y)).max() <= 0.6


def test_samples_outside_the_frame_repeat_its_border() -> None:
    """Samples beyond the frame repeat its last pixel, and `inside` says that there are any."""
    grid = polar_grid((5.0, 50.0), (10.0, 20.0), 170.0, 190.0)
    (unwrapped,) = Unwrapper([grid]).unwrap(ramp(2, 0), IDENTITY)

    assert unwrapped.tolist() == np.zeros_like(unwrapped).tolist()
    assert not inside(grid.rim(), IDENTITY, 120, 100)


@given(start_deg=ANGLES, sweep_deg=st.floats(10.0, 360.0), inner=st.floats(1.0, 60.0), depth=st.floats(2.0, 300.0))
def test_grid_covers_sweep_and_radius(start_deg: float, sweep_deg: float, inner: float, depth: float) -> None:
    """The first row and column lie on the start, the last on the end, to half a step."""
    grid = polar_grid(CENTRE, (inner, inner + depth), start_deg, start_deg + sweep_deg)

    assert grid.angle_deg(0) == start_deg
    assert grid.angle_deg(grid.rows - 1) == pytest.approx(start_deg + sweep_deg, abs=grid.step_deg / 2 + 1e-9)
    assert grid.inner_px + grid.column_px * (grid.columns - 1) == pytest.approx(inner + depth)
    assert 0 < grid.pixels_per_sample <= 1
