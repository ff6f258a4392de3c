"""Unwrapping: gauges sampled in polar coordinates, all of one frame in a single resampling of its original pixels.

In an unwrapped gauge rows are angle (0 degrees right, positive clockwise) and columns are radius, so that a turning
needle only shifts up and down (thesis 3.2.2). Alignment and unwrapping are one map: no pixel is interpolated twice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.parallax import Raised
from decoder.pictures import GreyPicture
from decoder.resampling import PointMap

UnwrappedGauge = Floats

# Oversampling beyond two rows a degree gained nothing on a 104-pixel dial, where a degree is 0.9 pixels of the rim;
# larger dials keep that density of about two rows a pixel until the rows become a cost of their own.
MIN_ROWS_PER_DEG = 2
MAX_ROWS_PER_DEG = 4
# Columns closer than this share their pixels.
COLUMN_PX = 1.5
MIN_COLUMNS = 3
MAX_COLUMNS = 64
RIM_POINTS = 25
# Rows that follow each other do so up to this.
ROUNDING_ROWS = 1e-9
_TAPS = np.array([[-1], [0], [1], [2]])


@dataclass(frozen=True, slots=True)
class PolarGrid:
    """The sample points of one unwrapped gauge.

    Row `i` lies at `start_deg + i * step_deg`, column `j` at `inner_px + j * column_px` from `centre`, in panel
    picture pixels. With `tail_columns` as many columns stand before these: what lies opposite, across the centre, from
    the rim inwards; so a row is a whole line through the dial, and a needle's tail stands in its row. With
    a `plane` angles and radii are those of the dial seen square on; it tells where they lie in the panel picture. What
    is `raised` above the panel is looked up where the camera sees it.
    """

    centre: tuple[float, float]
    start_deg: float
    step_deg: float
    rows: int
    inner_px: float
    column_px: float
    columns: int
    tail_columns: int = 0
    plane: DialPlane | None = None
    raised: Raised | None = None

    @property
    def radii_px(self) -> Floats:
        """(columns,): how far each column lies from the centre, negative across it."""
        outward = self.inner_px + self.column_px * np.arange(self.columns - self.tail_columns)
        radii: Floats = np.concatenate([-outward[: self.tail_columns][::-1], outward])
        return radii

    def points(self) -> Floats:
        """(2, rows, columns) float32: x and y of every sample in the panel picture."""
        return self.points_at(self.start_deg + self.step_deg * np.arange(self.rows), self.radii_px)

    def points_at(self, angles_deg: Floats, radii_px: Floats) -> Floats:
        """(2, len(angles_deg), len(radii_px)) float32: any points around the dial's centre, in its plane."""
        angles, radii = np.radians(angles_deg)[:, None], radii_px[None, :]
        if self.plane is not None:
            square_on = np.stack([np.cos(angles) * radii, np.sin(angles) * radii])
            return self.plane.to_panel(square_on.reshape(2, -1)).reshape(square_on.shape).astype(np.float32)
        points = np.empty((2, len(angles_deg), len(radii_px)), np.float32)
        for part, middle, across in zip(points, self.centre, (np.cos(angles), np.sin(angles)), strict=True):
            np.add(middle, across * radii, out=part, casting="same_kind")
        return points

    def rim(self) -> Floats:
        """(2, M) float32: points along its outer and inner arc, to tell whether it lies in a frame."""
        rows = (np.arange(RIM_POINTS) * ((self.rows - 1) / (RIM_POINTS - 1))).round()
        points = self.points_at(self.start_deg + self.step_deg * rows, self.radii_px[[-1, 0]])
        return np.concatenate([points[:, :, 0], points[:, :, 1]], axis=1)

    def at(self, angle_deg: float, rows: int) -> PolarGrid:
        """The same dial around one angle: an odd number of rows with `angle_deg` in the middle one."""
        start_deg = angle_deg - (rows - 1) / 2 * self.step_deg
        return replace(self, start_deg=start_deg, rows=rows)

    def angle_deg(self, row: float) -> float:
        """The angle of a (fractional) row."""
        return self.start_deg + row * self.step_deg

    @property
    def pixels_per_sample(self) -> float:
        """How much of a frame's pixel one sample stands for at the mean radius, at most 1."""
        sides = (self.columns - self.tail_columns, self.tail_columns)
        mean_px = self.inner_px + self.column_px * sum(count * (count - 1) / 2 for count in sides) / self.columns
        return min(1.0, math.radians(self.step_deg) * mean_px * self.column_px)


def polar_grid(
    centre: tuple[float, float],
    radius_px: tuple[float, float],
    start_deg: float,
    end_deg: float,
    *,
    across: bool = False,
    plane: DialPlane | None = None,
) -> PolarGrid:
    """The grid from `start_deg` to `end_deg` (both included) with a density that suits the dial's size.

    With `across` it has what lies opposite as well. A dial that is not seen square on has a `plane`.
    """
    rows_per_deg = min(max(MIN_ROWS_PER_DEG, math.ceil(math.radians(radius_px[1]))), MAX_ROWS_PER_DEG)
    length_px = radius_px[1] - radius_px[0]
    columns = min(max(math.floor(length_px / COLUMN_PX) + 1, MIN_COLUMNS), MAX_COLUMNS)
    rows = round((end_deg - start_deg) * rows_per_deg) + 1
    tail_columns = columns if across else 0
    column_px = length_px / (columns - 1)
    return PolarGrid(
        centre, start_deg, 1 / rows_per_deg, rows, radius_px[0], column_px, columns + tail_columns, tail_columns, plane
    )


class Unwrapper:
    """Samples several grids from a frame at once."""

    def __init__(self, grids: Sequence[PolarGrid]) -> None:
        self.grids = tuple(grids)

    @cached_property
    def _map(self) -> PointMap | None:
        flat = [grid for grid in self.grids if grid.raised is None]
        return PointMap.of([grid.points().reshape(2, -1) for grid in flat]) if flat else None

    @cached_property
    def _raised(self) -> dict[int, tuple[Raised, PointMap]]:
        return {
            index: (grid.raised, PointMap.of([grid.points().reshape(2, -1)]))
            for index, grid in enumerate(self.grids)
            if grid.raised is not None
        }

    def points(self, flat: Sequence[int]) -> Floats:
        """(N, 2) float32: x and y of every sample of some grids, none of them raised, one after the other."""
        if self._map is None:
            return np.empty((0, 2), np.float32)
        pairs = self._map.folded.reshape(-1, 2)
        parts = iter(self._map.slices)
        slices = [None if grid.raised is not None else next(parts) for grid in self.grids]
        return np.concatenate([pairs[slices[index]] for index in flat])

    def unwrap(self, frame: GreyPicture, alignment: Alignment) -> list[UnwrappedGauge]:
        """One (rows, columns) float32 array for each grid, in their order.

        Samples outside the frame repeat its border; `inside` tells whether there are any.
        """
        parts = iter(self._flat_parts(frame, alignment))
        unwrapped = []
        for index, grid in enumerate(self.grids):
            if index in self._raised:
                raised, points = self._raised[index]
                part = points.sample(frame, alignment.after(raised.seen_in(alignment)))
            else:
                part = next(parts)
            unwrapped.append(part.reshape(grid.rows, grid.columns))
        return unwrapped

    def _flat_parts(self, frame: GreyPicture, alignment: Alignment) -> list[Floats]:
        """The samples of the grids that lie in the panel's own plane."""
        if self._map is None:
            return []
        flat = self._map.sample(frame, alignment)
        return [flat[part] for part in self._map.slices]


def rows_at(strip: UnwrappedGauge, rows: Floats) -> UnwrappedGauge:
    """An unwrapped gauge at fractional rows, by cubic interpolation: (len(rows), C); beyond its ends, its end rows."""
    first = np.floor(rows).astype(np.intp)
    if len(rows) > 1 and first[0] >= 1 and rows[-1] - rows[0] == len(rows) - 1 and first[-1] + 2 < len(strip):
        return _shifted(strip, int(first[0]), len(rows), float(rows[0]) - int(first[0]))
    index = np.minimum(np.maximum(first + _TAPS, 0), len(strip) - 1)
    part = rows - first
    if not part.any():
        whole: UnwrappedGauge = strip[index[1]]
        return whole
    weights = np.stack(cubic_weights(part)).astype(np.float32)
    interpolated: UnwrappedGauge = np.einsum("kr,krc->rc", weights, strip[index])
    return interpolated


def rows_of_each(strips: Sequence[UnwrappedGauge], rows: Floats) -> Floats:
    """`rows_at` of K unwrapped gauges of one shape, each at rows of its own, (K, H): (K, H, C)."""
    first = np.floor(rows[:, 0]).astype(np.intp)
    follow = np.abs(rows[:, -1] - rows[:, 0] - (rows.shape[1] - 1)) < ROUNDING_ROWS
    follow &= (first >= 1) & (np.floor(rows[:, -1]).astype(np.intp) + 2 < len(strips[0])) & (rows.shape[1] > 1)
    if not follow.all():
        return np.stack([rows_at(strip, own) for strip, own in zip(strips, rows, strict=True)])
    count, height, columns = *rows.shape, strips[0].shape[1]
    parts = np.empty((count, height + 3, columns), np.float32)
    for part, strip, start in zip(parts, strips, (first - 1).tolist(), strict=True):
        part[:] = strip[start : start + height + 3]
    one, row, column = parts.strides
    taps = np.ndarray((count, 4, height * columns), parts.dtype, parts, strides=(one, row, column))
    weights = np.array([cubic_weights(behind) for behind in (rows[:, 0] - first).tolist()], np.float32)
    found: Floats = np.einsum("kt,ktx->kx", weights, taps)
    return found.reshape(count, height, columns)


def cubic_weights(part: Any) -> tuple[Any, Any, Any, Any]:  # noqa: ANN401 - a number or an array
    """Of the row before a place, its own, and the two behind, for a place so far behind its own (Catmull and Rom)."""
    square = part * part
    return (
        -0.5 * part + square - 0.5 * square * part,
        1.0 - 2.5 * square + 1.5 * square * part,
        0.5 * part + 2.0 * square - 1.5 * square * part,
        0.5 * square * (part - 1.0),
    )


def _shifted(strip: UnwrappedGauge, first: int, count: int, part: float) -> UnwrappedGauge:
    """`rows_at` for rows that follow each other: no row of the strip is looked up by itself."""
    if part == 0.0:
        return strip[first : first + count].copy()
    weights = [np.float32(weight) for weight in cubic_weights(part)]
    parts = [strip[first + tap : first + tap + count] for tap in (-1, 0, 1, 2)]
    shifted: UnwrappedGauge = weights[0] * parts[0]
    for weight, rows in zip(weights[1:], parts[1:], strict=True):
        shifted += weight * rows
    return shifted
