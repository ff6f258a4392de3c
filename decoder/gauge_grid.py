"""The grid of a gauge: which angles and radii its unwrapped form covers, and on which rows its needles may point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decoder.panel import FULL_CIRCLE_DEG, Gauge
from decoder.unwrapping import PolarGrid, polar_grid

# A needle may stand a little beyond the last mark.
BEYOND_SWEEP_DEG = 4.0
# What a cropped template covers if the panel does not say.
PICTURE_SPAN_DEG = 16.0


def gauge_grid(gauge: Gauge) -> PolarGrid:
    """The unwrapped gauge's sample points: its sweep, and as much beyond as the widest template needs."""
    widest_deg = max(needle.template.span or PICTURE_SPAN_DEG for needle in gauge.needles)
    margin_deg = _beyond_deg(gauge) + widest_deg / 2 + 1.0
    return polar_grid(gauge.centre, gauge.radius, gauge.sweep[0] - margin_deg, gauge.sweep[1] + margin_deg)


def rows_in_sweep(gauge: Gauge, grid: PolarGrid) -> NDArray[np.bool_]:
    """(R,): the rows on which a needle's axis may lie."""
    angles_deg = grid.angle_deg(0) + grid.step_deg * np.arange(grid.rows)
    beyond_deg = _beyond_deg(gauge)
    return (angles_deg >= gauge.sweep[0] - beyond_deg) & (angles_deg <= gauge.sweep[1] + beyond_deg)


def row_of_angle(grid: PolarGrid, angle_deg: float) -> float:
    """The row of an angle on the grid, whole turns added or taken off as needed."""
    return (angle_deg - grid.start_deg) % FULL_CIRCLE_DEG / grid.step_deg


def _beyond_deg(gauge: Gauge) -> float:
    return min(BEYOND_SWEEP_DEG, (FULL_CIRCLE_DEG - (gauge.sweep[1] - gauge.sweep[0])) / 2)
