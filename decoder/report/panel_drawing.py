"""The set-up as the report shows it: the panel picture, and what `panel.yaml` says of it as shapes to draw over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from decoder.alignment import Point
from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.gauge import Gauge
from decoder.gauge_grid import gauge_grid
from decoder.panel_pictures import PanelPictures
from decoder.report.evidence import jpeg_text
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.unwrapping import PolarGrid

WIDEST_PX = 1600
JPEG_QUALITY = 78
ARC_STEP_DEG = 4.0
TICK_PART = 0.14  # of the radius, inward from the perimeter
LETTER_WIDTH, LINE_HEIGHT = 0.62, 1.15  # of a text, in its size
VALUE_AT = 1.17  # outside the rim, where the dial's own numerals stay in sight


@dataclass(frozen=True, slots=True)
class Mark:
    """A tick mark: from inside to the perimeter, and where its value is written."""

    line: str
    at: Point
    text: str


@dataclass(frozen=True, slots=True)
class NeedleDrawing:
    """A needle as its template was taken: from its bottom to its tip; empty where that is a picture of its own."""

    name: str
    line: str


@dataclass(frozen=True, slots=True)
class GaugeDrawing:
    """One gauge: SVG point lists in the panel picture's pixels.

    `name_at` is where its name is written; `moved_to` the pivot that the flight showed, if it is another.
    """

    name: str
    rim: str
    sweep: str
    centre: Point
    name_at: Point
    text_px: float
    marks: tuple[Mark, ...]
    needles: tuple[NeedleDrawing, ...]
    moved_to: Point | None


@dataclass(frozen=True, slots=True)
class PanelDrawing:
    """The panel picture, its width and height, how large text is on it, and the gauges."""

    jpeg: str
    width: int
    height: int
    text_px: float
    gauges: tuple[GaugeDrawing, ...]


def panel_drawing(source: PanelPictures, moved_px: dict[str, Point]) -> PanelDrawing:
    """The drawing of a panel; `moved_px` by gauge, as in the flight data."""
    picture = source.picture
    height, width = picture.shape
    if width > WIDEST_PX:
        size = (WIDEST_PX, round(height * WIDEST_PX / width))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    planes = source.with_planes().planes or (None,) * len(source.panel.gauges)
    text_px = max(9.0, width / 78)
    gauges = tuple(
        _gauge(gauge, plane, moved_px.get(gauge.name), text_px)
        for gauge, plane in zip(source.panel.gauges, planes, strict=True)
    )
    return PanelDrawing(jpeg_text(picture, JPEG_QUALITY), width, height, text_px, _legible(gauges, text_px))


def _legible(gauges: Sequence[GaugeDrawing], text_px: float) -> tuple[GaugeDrawing, ...]:
    """The gauges, each name set a line further down where it would stand in one before, as two dials' of one case."""
    placed: list[GaugeDrawing] = []
    for gauge in gauges:
        x, y = gauge.name_at
        while any(
            abs(x - other.name_at[0]) < LETTER_WIDTH * text_px * (len(gauge.name) + len(other.name)) / 2
            and abs(y - other.name_at[1]) < text_px
            for other in placed
        ):
            y += LINE_HEIGHT * text_px
        placed.append(replace(gauge, name_at=(x, y)))
    return tuple(placed)


def _gauge(gauge: Gauge, plane: DialPlane | None, moved_px: Point | None, most_px: float) -> GaugeDrawing:
    grid, radius = gauge_grid(gauge, plane), gauge.radius[1]
    first, last = gauge.sweep
    rim = _arc(grid, 0.0, FULL_CIRCLE_DEG)
    needles = tuple(NeedleDrawing(needle.name, _needle_line(grid, needle.template.at)) for needle in gauge.needles)
    if gauge.card is not None:
        needles = (NeedleDrawing(gauge.card.name, _needle_line(grid, gauge.card.index)),)
    centre = gauge.centre
    return GaugeDrawing(
        name=gauge.name,
        rim=_text(rim),
        sweep=_text(_arc(grid, first, last)),
        centre=(centre[0] + 0.5, centre[1] + 0.5),
        name_at=(float(rim[0].mean()) + 0.5, float(rim[1].max()) + 0.42 * radius),
        text_px=min(max(5.0, radius * 0.17), most_px),
        marks=tuple(_mark(grid, angle, value) for angle, value in gauge.scale),
        needles=needles,
        moved_to=None if moved_px is None else (centre[0] + moved_px[0] + 0.5, centre[1] + moved_px[1] + 0.5),
    )


def _mark(grid: PolarGrid, angle_deg: float, value: float) -> Mark:
    outer = _ray(grid, angle_deg)[:, -1]
    middle = _arc(grid, 0.0, FULL_CIRCLE_DEG - ARC_STEP_DEG).mean(axis=1)
    start, at = outer + (middle - outer) * TICK_PART, middle + (outer - middle) * VALUE_AT
    return Mark(_text(np.stack([start, outer], axis=1)), (float(at[0]) + 0.5, float(at[1]) + 0.5), f"{value:g}")


def _needle_line(grid: PolarGrid, angle_deg: float | None) -> str:
    return "" if angle_deg is None else _text(_ray(grid, angle_deg)[:, [grid.tail_columns, -1]])


def _ray(grid: PolarGrid, angle_deg: float) -> Floats:
    """(2, columns): the samples at one angle."""
    ray: Floats = grid.at(angle_deg, 1).points()[:, 0]
    return ray


def _arc(grid: PolarGrid, first_deg: float, last_deg: float) -> Floats:
    """(2, M): points of the perimeter from one angle to another."""
    angles = np.linspace(first_deg, last_deg, max(2, round((last_deg - first_deg) / ARC_STEP_DEG) + 1))
    return np.stack([_ray(grid, float(angle))[:, -1] for angle in angles], axis=1)


def _text(points: Floats) -> str:
    """(2, M) points as an SVG list, the pixel's corner being the origin."""
    return " ".join(f"{x + 0.5:.1f},{y + 0.5:.1f}" for x, y in points.T.tolist())
