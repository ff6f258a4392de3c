"""The camera's calibration as charts: pixels per radian over focal length, and what the lens does to straight lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from decoder.camera import Camera
from decoder.drawn_readings import CONFIDENCE_SIGMAS
from decoder.errors import CameraError

STEPS = 61

Chart = dict[str, Any]


def calibration_charts(camera: Camera, focal_length_mm: float | None) -> list[Chart]:
    """Charts for the page; `focal_length_mm` is that of the panel picture, if known."""
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
