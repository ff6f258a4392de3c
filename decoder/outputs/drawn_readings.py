"""What the readings look like on their frame: where each needle was found, its colour, and the text beside it.

Places follow from the needle's angle, its gauge's grid and the frame's alignment (or the dial's own place if it was
located by itself), the same way the gauge was unwrapped. So they show where the decoder looked, wherever the camera
was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decoder.imaging.alignment import Alignment
from decoder.imaging.motion import carried
from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import DialPlane
from decoder.imaging.unwrapping import gauge_grid, polar_grid
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import value_decimals
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from decoder.panel.kind import Polar
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.timeseries.flight_data import STATUSES, FlightData, NeedleSeries

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

STATUS_COLOURS: dict[Status, Colour] = {
    Status.READ: (38, 210, 150),
    Status.EDGE: (86, 190, 245),
    Status.HIDDEN: (222, 150, 216),
    Status.INTERPOLATED: (245, 180, 40),
    Status.MISSING: (250, 100, 70),
}

Point = tuple[float, float]
"""(x, y) in a frame's pixels, pixel centres on whole numbers."""

RIM_STEP_DEG = 6.0


@dataclass(frozen=True, slots=True)
class DrawnReading:
    """One value of one frame.

    Attributes
    ----------
    text
        Its value with unit, or the word `missing`.
    spread
        The 95 % interval, such as `± 0.16`; empty where there is no value.
    score
        NaN where the panel was not found.
    line_px
        In the frame: the needle from its bottom to its tip, or the line where a card or a horizon is read; None if
        there is no value, or no needle of its own.
    """

    name: str
    text: str
    spread: str
    status: Status
    score: float
    line_px: tuple[Point, Point] | None


@dataclass(frozen=True, slots=True)
class DrawnGauge:
    """One gauge in one frame: its pivot, its outer perimeter as a closed polygon, and its readings."""

    name: str
    pivot_px: Point
    rim_px: tuple[Point, ...]
    readings: tuple[DrawnReading, ...]

    @property
    def radius_px(self) -> float:
        """The mean distance of the perimeter from the pivot."""
        return sum(math.dist(self.pivot_px, point) for point in self.rim_px) / len(self.rim_px)

    @property
    def box_px(self) -> tuple[float, float, float, float]:
        """The bounding box of the perimeter: left, top, right, bottom."""
        xs, ys = zip(*self.rim_px, strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    def part_px(self, reach: float, size_px: tuple[int, int]) -> tuple[int, int, int, int]:
        """Return the part of a frame of this size within `reach` radii of it: left, top, right, bottom."""
        left, top, right, bottom = self.box_px
        x, y, reach_px = (left + right) / 2, (top + bottom) / 2, reach * max(right - left, bottom - top) / 2
        low = (max(0, x - reach_px), max(0, y - reach_px))
        high = (min(size_px[0], x + reach_px), min(size_px[1], y + reach_px))
        left, top, right, bottom = (math.floor(side) for side in (*low, *high))
        return left, top, right, bottom


class ReadingPlaces:
    """Tells what to draw where, for each frame of a flight."""

    def __init__(self, source: PanelPictures, data: FlightData) -> None:
        self._data = data
        by_gauge: dict[str, list[NeedleSeries]] = {gauge.name: [] for gauge in source.panel.gauges}
        for series in data.series:
            by_gauge[series.quantity.gauge].append(series)
        placed = source.with_planes()
        planes = placed.planes or (None,) * len(by_gauge)
        self._gauges = [
            _PlacedGauge(
                *_around_pivot(gauge, plane, placed.optics, data.moved_pivots_px.get(gauge.name)), by_gauge[gauge.name]
            )
            for gauge, plane in zip(source.panel.gauges, planes, strict=True)
        ]

    def frame(self, index: int) -> tuple[DrawnGauge, ...]:
        """Place the gauges of one frame, by its row in the flight data; empty where the panel was not found."""
        alignment = self._data.alignments[index] if self._data.alignments else None
        if alignment is None:
            return ()
        shifts_px = [self._data.alignments.shift_px(index, place) for place in range(len(self._gauges))]
        return tuple(
            gauge.drawn(index, _moved(alignment, shift_px))
            for gauge, shift_px in zip(self._gauges, shifts_px, strict=True)
        )


class _PlacedGauge:
    """One gauge and what is read off it."""

    def __init__(self, gauge: Gauge, plane: DialPlane | None, series: list[NeedleSeries]) -> None:
        self._gauge = gauge
        self._grid = gauge_grid(gauge, plane)
        outer = _outline(gauge, plane)
        pivot = np.array(gauge.centre)[:, None] if plane is None else plane.to_panel(np.zeros((2, 1)))
        self._pivot_and_rim: Floats = np.concatenate([pivot, outer], axis=1)
        pointers = gauge.pointers
        self._fixed_deg = {pointer.name: pointer.at_deg for pointer in pointers if pointer.is_fixed}
        self._scales = {
            one.quantity.name: Scale.of(one.quantity.marks, one.quantity.wraps)
            for one in series
            if one.quantity.name in {pointer.name for pointer in pointers if not pointer.is_fixed}
        }
        self._series = [(one, label_decimals(one)) for one in series]

    def drawn(self, index: int, alignment: Alignment) -> DrawnGauge:
        pivot_px, *rim_px = _in_frame(self._pivot_and_rim, alignment)
        lines = self._gauge.lines({series.quantity.name: float(series.value[index]) for series, _ in self._series})
        return DrawnGauge(
            name=self._gauge.name,
            pivot_px=pivot_px,
            rim_px=tuple(rim_px),
            readings=tuple(
                drawn_reading(
                    series,
                    index,
                    decimals,
                    line_px=(
                        self._across(lines[series.quantity.name], alignment)
                        if series.quantity.name in lines
                        else self._line(series, index, alignment)
                    ),
                )
                for series, decimals in self._series
            ),
        )

    def _across(self, line: tuple[Polar, Polar] | None, alignment: Alignment) -> tuple[Point, Point] | None:
        if line is None:
            return None
        ends = [self._grid.points_at(np.array([angle_deg]), np.array([px]))[:, 0, 0] for angle_deg, px in line]
        first_px, last_px = _in_frame(np.stack(ends, axis=1), alignment)
        return first_px, last_px

    def _line(self, series: NeedleSeries, index: int, alignment: Alignment) -> tuple[Point, Point] | None:
        angle_deg = self._angle_deg(series.quantity.name, float(series.value[index]))
        if angle_deg is None:
            return None
        points = self._grid.at(angle_deg, 1).points()[:, 0]
        bottom_px, tip_px = _in_frame(points[:, [self._grid.tail_columns, -1]], alignment)
        return bottom_px, tip_px

    def _angle_deg(self, name: str, value: float) -> float | None:
        if not math.isfinite(value):
            return None
        if name in self._fixed_deg:
            return self._fixed_deg[name]
        scale = self._scales.get(name)
        return None if scale is None else float(scale.angles_of(np.array([value]))[0])


def _outline(gauge: Gauge, plane: DialPlane | None) -> Floats:
    """(2, N): a dial's outer perimeter in the panel picture, or a window's corners."""
    if gauge.window is not None:
        return np.array(gauge.window).T
    around = polar_grid(gauge.centre, gauge.radius, 0.0, FULL_CIRCLE_DEG - RIM_STEP_DEG, plane=plane)
    outer: Floats = around.points()[:, :: round(RIM_STEP_DEG / around.step_deg), -1]
    return outer


def _moved(alignment: Alignment, shift_px: Point) -> Alignment:
    """Shift an alignment by pixels of the panel picture."""
    x, y = shift_px
    return alignment if x == y == 0.0 else alignment.after(np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]))


def _in_frame(points: Floats, alignment: Alignment) -> list[Point]:
    """Carry (2, N) points of the panel picture into the frame."""
    places = alignment.places(np.ascontiguousarray(points.T[None], np.float32))
    return [(x, y) for x, y in places[0].tolist()]


def _around_pivot(
    gauge: Gauge, plane: DialPlane | None, optics: Optics, moved_px: Point | None
) -> tuple[Gauge, DialPlane | None]:
    """Move a gauge and its plane to the pivot that was found; `moved_px` in the panel picture as taken."""
    if moved_px is None:
        return gauge, plane
    centre = (gauge.centre[0] + moved_px[0], gauge.centre[1] + moved_px[1])
    if plane is not None:
        there = np.asarray(optics.straight(np.array(centre, np.float64)[:, None]), np.float64)
        offset = carried(np.asarray(np.linalg.inv(plane.matrix), np.float64), there)[:, 0]
        plane = plane.around((float(offset[0]), float(offset[1])))
    return gauge.model_copy(update={"centre": centre}), plane


def drawn_reading(
    series: NeedleSeries, index: int, decimals: int, line_px: tuple[Point, Point] | None = None
) -> DrawnReading:
    """Format one value of one frame, by its row in the flight data."""
    return DrawnReading(
        name=series.quantity.name,
        text=_text(series, index, decimals),
        spread=spread_text(float(series.sigma[index]), decimals) if series.quantity.is_measured else "",
        status=STATUSES[series.status[index]],
        score=float(series.score[index]),
        line_px=line_px,
    )


def _text(series: NeedleSeries, index: int, decimals: int) -> str:
    value, written = float(series.value[index]), series.quantity.written
    if written is None or not math.isfinite(value):
        return value_text(value, decimals, series.quantity.unit)
    return f"{written.text_of(value)} {series.quantity.unit}".rstrip()


def label_decimals(series: NeedleSeries) -> int:
    """Return the decimals for labels on a picture: a hundred-thousandth of full scale, about as precise as readings."""
    return value_decimals(series) - (series.quantity.written is None)


def spread_text(sigma: float, decimals: int) -> str:
    """Write the half of a 95 % interval with at least one digit that is not 0, since no value is certain."""
    spread = CONFIDENCE_SIGMAS * sigma
    if not math.isfinite(spread):
        return ""
    needed = -math.floor(math.log10(spread)) if spread > 0.0 else 0
    return f"± {spread:.{max(decimals, needed)}f}"


def value_text(value: float, decimals: int, unit: str) -> str:
    """Format a value with its unit, or `missing`."""
    if not math.isfinite(value):
        return Status.MISSING.value
    return f"{value:.{decimals}f} {unit}".rstrip()
