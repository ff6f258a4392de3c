"""The report's drawings: the set-up over the panel picture, and the camera's calibration as charts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from decoder.imaging.alignment import Point
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import DialPlane
from decoder.imaging.unwrapping import PolarGrid, gauge_grid
from decoder.outputs.report.flags import jpeg_text
from decoder.outputs.thresholds import PICTURE_PX
from decoder.panel.arrays import Floats
from decoder.panel.camera import Camera
from decoder.panel.errors import CameraError
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG
from decoder.panel.thresholds import CONFIDENCE_SIGMAS

JPEG_QUALITY = 78
ARC_STEP_DEG = 4.0
TICK_PART = 0.14  # of the radius, inward from the perimeter
LINE_HEIGHT = 1.15  # of a text, in its size
LETTER_WIDTH = 0.62  # of a letter without serifs, in its size
VALUE_AT = 1.17  # outside the rim, so that the dial's own numerals stay visible

STEPS = 61

Chart = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Mark:
    """A tick mark: from inside to the perimeter, and where its value is written."""

    line: str
    at: Point
    text: str


@dataclass(frozen=True, slots=True)
class NeedleDrawing:
    """A needle where its template was cut: from its bottom to its tip; empty if that is a separate picture."""

    name: str
    line: str


@dataclass(frozen=True, slots=True)
class GaugeDrawing:
    """One gauge: SVG point lists in the panel picture's pixels.

    `name_at` is where its name is written; `moved_to` the pivot found in the flight, if it differs.
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
    """The panel picture, its width and height, the size of text on it, and the gauges."""

    jpeg: str
    width: int
    height: int
    text_px: float
    gauges: tuple[GaugeDrawing, ...]


def panel_drawing(source: PanelPictures, moved_px: dict[str, Point]) -> PanelDrawing:
    """Draw a panel; `moved_px` by gauge, as in the flight data."""
    picture = source.picture
    height, width = picture.shape
    if width > PICTURE_PX:
        size = (PICTURE_PX, round(height * PICTURE_PX / width))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    planes = source.with_planes().planes or (None,) * len(source.panel.gauges)
    text_px = max(9.0, width / 78)
    gauges = tuple(
        _gauge(gauge, plane, moved_px.get(gauge.name), text_px)
        for gauge, plane in zip(source.panel.gauges, planes, strict=True)
    )
    return PanelDrawing(jpeg_text(picture, JPEG_QUALITY), width, height, text_px, _legible(gauges, text_px))


def _legible(gauges: Sequence[GaugeDrawing], text_px: float) -> tuple[GaugeDrawing, ...]:
    """Move each gauge's name a line down where it would overlap one before, as for two dials in one case."""
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
    needles = tuple(NeedleDrawing(pointer.name, _needle_line(grid, pointer.at_deg)) for pointer in gauge.pointers)
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
    angles = np.linspace(first_deg, last_deg, math.ceil((last_deg - first_deg) / ARC_STEP_DEG) + 1)
    return np.stack([_ray(grid, float(angle))[:, -1] for angle in angles], axis=1)


def _text(points: Floats) -> str:
    """(2, M) points as an SVG list, with the origin at the pixel's corner."""
    return " ".join(f"{x + 0.5:.1f},{y + 0.5:.1f}" for x, y in points.T.tolist())


def calibration_charts(camera: Camera, focal_length_mm: float | None) -> list[Chart]:
    """Make charts for the page; `focal_length_mm` is that of the panel picture, if known."""
    return [_focal(camera, focal_length_mm), *_distortion(camera)]


def _focal(camera: Camera, focal_length_mm: float | None) -> Chart:
    lengths = np.linspace(*camera.focal.range_mm, STEPS)
    values = np.array([camera.focal.at(length) for length in lengths])
    spread = CONFIDENCE_SIGMAS * np.array([camera.focal.sigma(length) for length in lengths])
    marks = None
    if focal_length_mm is not None and camera.covers(focal_length_mm):
        marks = {"name": "the panel picture", "x": [focal_length_mm], "y": [camera.focal.at(focal_length_mm)]}
    line = {"name": "pixels per radian", "x": _plain(lengths), "y": _plain(values)}
    if spread.any():
        line |= {
            "name": "pixels per radian, 95 % band",
            "low": _plain(values - spread),
            "high": _plain(values + spread),
        }
    return {
        "title": "Focal length",
        "words": f"Pixels per radian over focal length, for pictures {camera.picture_size[0]} pixels wide.",
        "x": "focal length, mm",
        "y": "pixels per radian",
        "lines": [line],
        "marks": marks,
    }


def _distortion(camera: Camera) -> list[Chart]:
    lines = []
    for entry in camera.distortion:
        try:
            lens = camera.lens(entry.focal_length_mm, camera.picture_size)
        except CameraError:
            continue  # measured at a zoom that the calibration does not cover
        middle, corner = np.array(lens.principal_point_px)[:, None], np.array(camera.picture_size)[:, None] - 1.0
        straight = middle + (corner - middle) * np.linspace(0.0, 1.0, STEPS)
        away = np.linalg.norm(straight - middle, axis=0)
        bent = np.linalg.norm(lens.distorted(straight) - middle, axis=0) - away
        lines.append({"name": f"at {entry.focal_length_mm:g} mm", "x": _plain(away), "y": _plain(bent)})
    if not lines:
        return []
    return [
        {
            "title": "Distortion",
            "words": "How far the lens moves a point outward, from the middle of the picture to its corner.",
            "x": "pixels from the middle",
            "y": "moved outward, pixels",
            "lines": lines,
            "marks": None,
        }
    ]


def _plain(values: Any) -> list[float]:  # noqa: ANN401 - any array
    return [round(float(value), 4) for value in values]
