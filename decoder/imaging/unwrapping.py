"""Unwrapping: gauges sampled in polar coordinates, all of one frame in a single resampling of its original pixels.

In an unwrapped gauge rows are angle (0 degrees right, positive clockwise) and columns are radius, so that a turning
needle only shifts up and down (thesis 3.2.2). Alignment and unwrapping are one map: no pixel is interpolated twice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment
from decoder.imaging.motion import carried, homography
from decoder.imaging.pictures import Coloured, ColourPicture, GreyPicture, Mixed
from decoder.imaging.planes import DialPlane, Raised
from decoder.imaging.resampling import MixedPart, PointMap, levels_at
from decoder.imaging.thresholds import COLUMN_PX, MAX_COLUMNS, MIN_COLUMNS, MIN_ROWS_PER_DEG
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.straight import size_px, steadied
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.panel.window import Corners

UnwrappedGauge = Floats

RIM_POINTS = 25


@dataclass(frozen=True, slots=True)
class PolarGrid:
    """The sample points of one unwrapped gauge.

    Row `i` lies at `start_deg + i * step_deg`, column `j` at `inner_px + j * column_px` from `centre`, in panel
    picture pixels. As many `tail_columns` precede these: they hold the opposite side of the dial, across the centre,
    from the rim inwards, so a row is a whole line through the dial and includes a needle's tail. With a `plane`, angles
    and radii are those of the dial seen square on, and the plane gives their places in the panel picture. A gauge whose
    needles are `raised` above the panel is sampled where the camera sees them. With a `mixture`, it is sampled in that
    grey.
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
    mixture: Mixed | None = None

    @property
    def radii_px(self) -> Floats:
        """(columns,): the distance of each column from the centre, negative across it."""
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
        """(2, M) float32: points along its outer and inner arc, to test whether it lies in a frame."""
        rows = (np.arange(RIM_POINTS) * ((self.rows - 1) / (RIM_POINTS - 1))).round()
        points = self.points_at(self.start_deg + self.step_deg * rows, self.radii_px[[-1, 0]])
        return np.concatenate([points[:, :, 0], points[:, :, 1]], axis=1)

    def at(self, angle_deg: float, rows: int) -> PolarGrid:
        """Cut the grid down to one angle: an odd number of rows with `angle_deg` in the middle one."""
        start_deg = angle_deg - (rows - 1) / 2 * self.step_deg
        return replace(self, start_deg=start_deg, rows=rows)

    def angle_deg(self, row: float) -> float:
        """Convert a (fractional) row to its angle."""
        return self.start_deg + row * self.step_deg

    @property
    def pixels_per_sample(self) -> float:
        """How much of a frame's pixel one sample covers at the mean radius, at most 1."""
        sides = (self.columns - self.tail_columns, self.tail_columns)
        mean_px = self.inner_px + self.column_px * sum(count * (count - 1) / 2 for count in sides) / self.columns
        return min(1.0, math.radians(self.step_deg) * mean_px * self.column_px)


@dataclass(frozen=True, slots=True)
class WindowGrid:
    """The sample points of a window, whose corners may be seen from any side: rows go down, columns across.

    Samples lie in the middles of cells about as large as a pixel; on each side, `margin` cells of the surroundings are
    sampled too. A window is a plane of its own, never `raised`.
    """

    corners: Corners
    rows: int
    columns: int
    margin: int = 0
    plane: DialPlane | None = None
    raised: Raised | None = None
    mixture: Mixed | None = None

    @classmethod
    def of(cls, corners: Corners, margin_part: float = 0.0) -> WindowGrid:
        """Lay it out with a cell for each pixel, and a margin that is this part of its shorter side."""
        width, height = (math.ceil(side_px) for side_px in size_px(corners))
        margin = math.ceil(margin_part * min(width, height))
        return cls(corners, height + 2 * margin, width + 2 * margin, margin)

    @property
    def within(self) -> tuple[slice, slice]:
        """Rows and columns of the window itself."""
        return slice(self.margin, self.rows - self.margin), slice(self.margin, self.columns - self.margin)

    @property
    def cell_px(self) -> tuple[float, float]:
        """The width and height of a cell on the panel picture, on average."""
        width_px, height_px = size_px(self.corners)
        return width_px / (self.columns - 2 * self.margin), height_px / (self.rows - 2 * self.margin)

    def points(self) -> Floats:
        """(2, rows, columns) float32: x and y of every sample in the panel picture."""
        across, down = (
            (np.arange(count) - self.margin + 0.5) / (count - 2 * self.margin) for count in (self.columns, self.rows)
        )
        return self.points_at(across, down)

    def points_at(self, across: Floats, down: Floats) -> Floats:
        """(2, len(down), len(across)) float32: any points of the window, from 0 at its top left to 1."""
        unit = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
        places = np.stack([part.ravel() for part in np.meshgrid(across, down)]).astype(np.float64)
        there = carried(homography(unit, np.array(steadied(self.corners)).T), places)
        points: Floats = there.reshape(2, len(down), len(across)).astype(np.float32)
        return points

    def rim(self) -> Floats:
        """(2, 4) float32: its corners, to test whether it lies in a frame."""
        return np.array(self.corners, np.float32).T


Grid = PolarGrid | WindowGrid


def polar(grid: Grid) -> PolarGrid:
    """Return the grid of a dial."""
    if not isinstance(grid, PolarGrid):
        raise AssertionError("a window has no angles")  # noqa: TRY004 - whoever asks knows which it is
    return grid


def windowed(grid: Grid) -> WindowGrid:
    """Return the grid of a window."""
    if not isinstance(grid, WindowGrid):
        raise AssertionError("a dial has no corners")  # noqa: TRY004 - the same
    return grid


def polar_grid(
    centre: tuple[float, float],
    radius_px: tuple[float, float],
    start_deg: float,
    end_deg: float,
    *,
    across: bool = False,
    fine: bool = False,
    plane: DialPlane | None = None,
) -> PolarGrid:
    """Lay out the grid from `start_deg` to `end_deg` (both included) with a density that suits the dial's size.

    With `across` it includes what lies opposite as well; with `fine` rows are as far apart as pixels, however large it
    is. A dial that is not seen square on has a `plane`.
    """
    rows_per_deg = max(MIN_ROWS_PER_DEG, math.ceil(math.radians(radius_px[1])))
    if not fine:
        rows_per_deg = min(rows_per_deg, 2 * MIN_ROWS_PER_DEG)
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

    def __init__(self, grids: Sequence[Grid]) -> None:
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

    @cached_property
    def mixed(self) -> dict[int, tuple[Mixed, PointMap]]:
        """By index, the grids that are not sampled in luma: their mixture and their points."""
        return {
            index: (grid.mixture, PointMap.of([grid.points().reshape(2, -1)]))
            for index, grid in enumerate(self.grids)
            if grid.mixture is not None
        }

    def mixed_parts(self, colour: ColourPicture, alignment: Alignment) -> dict[int, MixedPart]:
        """Mix the colours of a frame around those grids; none of them is raised."""
        return {
            index: MixedPart.of(colour, mixture, points.places(alignment))
            for index, (mixture, points) in self.mixed.items()
        }

    def unwrap(
        self, frame: GreyPicture, alignment: Alignment, in_colour: Coloured | None = None
    ) -> list[UnwrappedGauge]:
        """Sample one (rows, columns) float32 array for each grid, in order.

        Samples outside the frame repeat its border; `inside` tells whether there are any. Without its colours a frame
        is all grey.
        """
        parts = iter(self._flat_parts(frame, alignment))
        colour = None if in_colour is None or not self.mixed else in_colour()
        unwrapped = []
        for index, grid in enumerate(self.grids):
            there = alignment
            if index in self._raised:
                raised, points = self._raised[index]
                there = alignment.after(raised.seen_in(alignment))
                part = points.sample(frame, there)
            else:
                part = next(parts)
            if colour is not None and index in self.mixed:
                part = _mixed_levels(colour, there, *self.mixed[index])
            unwrapped.append(part.reshape(grid.rows, grid.columns))
        return unwrapped

    def colours(self, frame: ColourPicture, alignment: Alignment) -> list[Floats]:
        """(rows, columns, 3) float32 for each grid: as `unwrap`, in red, green and blue."""
        seen = []
        for grid in self.grids:
            there = alignment if grid.raised is None else alignment.after(grid.raised.seen_in(alignment))
            points = PointMap.of([grid.points().reshape(2, -1)])
            seen.append(points.colours(frame, there).reshape(grid.rows, grid.columns, 3))
        return seen

    def _flat_parts(self, frame: GreyPicture, alignment: Alignment) -> list[Floats]:
        """Sample the grids that lie in the panel's own plane."""
        if self._map is None:
            return []
        flat = self._map.sample(frame, alignment)
        return [flat[part] for part in self._map.slices]


def _mixed_levels(colour: ColourPicture, alignment: Alignment, mixture: Mixed, points: PointMap) -> Floats:
    """(N,) float32: a grid's samples in its own mixture."""
    part = MixedPart.of(colour, mixture, points.places(alignment))
    levels = levels_at(part.pixels, points.places(alignment, part.origin))[: points.slices[-1].stop]
    return levels.astype(np.float32)


def grid_of(gauge: Gauge, plane: DialPlane | None = None) -> Grid:
    """Lay out the sample points of a gauge: of its dial, or of its window."""
    return gauge_grid(gauge, plane) if gauge.window is None else WindowGrid.of(gauge.window, gauge.kind.margin_part)


def gauge_grid(gauge: Gauge, plane: DialPlane | None = None) -> PolarGrid:
    """Lay out the unwrapped dial's sample points; for a window those of the circle around it."""
    return polar_grid(
        gauge.centre, gauge.radius, *gauge.unwrapped_deg, across=gauge.tail, fine=gauge.is_in_picture, plane=plane
    )


def rows_in_sweep(gauge: Gauge, grid: PolarGrid) -> NDArray[np.bool_]:
    """(R,): the rows on which a needle's axis may lie."""
    angles_deg = grid.angle_deg(0) + grid.step_deg * np.arange(grid.rows)
    first_deg, last_deg = gauge.reach
    return (angles_deg >= first_deg - gauge.beyond_deg) & (angles_deg <= last_deg + gauge.beyond_deg)


def row_of_angle(grid: PolarGrid, angle_deg: float) -> float:
    """Find the row of an angle on the grid, modulo whole turns: the one nearest to the grid's middle."""
    middle = (grid.rows - 1) / 2
    turn_rows = FULL_CIRCLE_DEG / grid.step_deg
    off = (angle_deg - grid.start_deg) / grid.step_deg - middle
    return middle + off - turn_rows * round(off / turn_rows)


def turn_rows(gauge: Gauge, grid: PolarGrid) -> float | None:
    """Return how many rows a full turn has, if the dial is read all the way round."""
    return FULL_CIRCLE_DEG / grid.step_deg if gauge.is_round else None


def same_rows(row: float, turn: float | None) -> tuple[float, ...]:
    """List all rows at which the content of one row repeats, on the grid or beyond it."""
    return (row,) if turn is None else (row - turn, row, row + turn)


def opposite_rows(row: float, grid: PolarGrid) -> tuple[float, ...]:
    """List the rows at which the content of one row repeats with its columns reversed; none without tails."""
    half = FULL_CIRCLE_DEG / grid.step_deg / 2
    return (row - 3 * half, row - half, row + half, row + 3 * half) if grid.tail_columns else ()


def needle_places(grid: PolarGrid, touched: Mask, axis_row: float, turn: float | None) -> Mask:
    """(R, C): all pixels of the grid that a needle with its axis on a row touches; `touched` (H, C) of its template."""
    place = np.zeros((grid.rows, grid.columns), bool)
    place.reshape(-1)[touched_pixels(grid, touched, axis_row, turn)] = True
    return place


def touched_pixels(grid: PolarGrid, touched: Mask, axis_row: float, turn: float | None) -> Indices:
    """(N,): the same pixels as flat indices; some may be repeated."""
    shape = (grid.rows, grid.columns)
    return np.concatenate(
        [needle_pixels(shape, touched, row) for row in same_rows(axis_row, turn)]
        + [needle_pixels(shape, touched[:, ::-1], row) for row in opposite_rows(axis_row, grid)]
    )


def needle_pixels(shape: tuple[int, int], touched: Mask, axis_row: float) -> Indices:
    """(N,): flat indices of all pixels that a needle with its axis on a row touches on a gauge of R by C pixels.

    `touched` (H, C) are those of its template.
    """
    rows, columns = touched.shape
    top = axis_row - (rows - 1) / 2
    start = math.floor(top)
    place = np.zeros((rows + 1, columns), bool)
    place[:rows] = touched
    if top > start:  # between two rows, it touches the pixels that it would touch on either
        place[1:] |= touched
    first, last = max(start, 0), min(start + rows + 1, shape[0])
    if first >= last:
        return np.empty(0, np.intp)
    pixels: Indices = np.flatnonzero(place[first - start : last - start]) + first * columns
    return pixels
