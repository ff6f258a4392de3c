"""A plane with features on it, drawn from formulas through any homography and lens: the truth is exact.

The plane's units are the panel picture's pixels. Knobs are smooth patterns of which no two are alike, except twins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from decoder.imaging.pictures import GreyPicture
from decoder.panel.lens import Lens
from decoder.panel.panel import Panel, parse_panel
from tests.decoder.cockpit import near_points

Field = NDArray[np.float64]
Matrix = NDArray[np.float64]

SIZE_PX = (640, 480)
KNOB_PX = 15.0
KNOBS = {
    "north_west": (60.0, 50.0),
    "north_east": (575.0, 62.0),
    "south_west": (52.0, 420.0),
    "south_east": (590.0, 415.0),
    "north": (310.0, 45.0),
    "south": (330.0, 430.0),
}
GAUGE_PX = (320.0, 240.0)
DIAL_PX = 60.0


def _knob(x: Field, y: Field, kind: int) -> Field:
    """A smooth pattern with detail in both directions, another one for each kind."""
    a, b = 0.24 + 0.03 * (kind % 4), 0.33 - 0.025 * (kind % 5)
    return 35.0 * (
        np.sin(a * x + 0.1 * y + kind) + np.sin(b * y - 0.08 * x + 2.1 * kind) + np.sin(0.012 * x * y + kind)
    )


def _plane(x: Field, y: Field, knobs: Sequence[tuple[float, float, int]]) -> Field:
    """Grey levels of the plane at points."""
    light = np.full_like(x, 70.0)
    for cx, cy, kind in knobs:
        near, along, across = near_points(x, y, (cx, cy), KNOB_PX)
        inside = 0.5 * (1.0 - np.tanh((np.hypot(along, across) - KNOB_PX) / 1.2))
        light[near] += (120.0 + _knob(along, across, kind) - light[near]) * inside
    near, along, across = near_points(x, y, GAUGE_PX, DIAL_PX)
    dial = 0.5 * (1.0 - np.tanh((np.hypot(along, across) - DIAL_PX) / 1.2))
    light[near] += (40.0 - light[near]) * dial
    hand = 0.5 * (1.0 - np.tanh((np.abs(across) - 2.0) / 0.9)) * (along > 0) * 0.5 * (1 - np.tanh((along - 52.0) / 0.9))
    light[near] += (220.0 - light[near]) * hand
    return light


def see(
    motion: Matrix,
    *,
    size_px: tuple[int, int] = SIZE_PX,
    lens: Lens | None = None,
    twins: bool = False,
    gain: float = 1.0,
    offset: float = 0.0,
    slope: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
) -> GreyPicture:
    """A frame: `motion` carries the plane's points to the frame's pixels, the lens bends them there."""
    v, u = np.mgrid[0 : size_px[1], 0 : size_px[0]].astype(np.float64)
    points = np.stack([u.ravel(), v.ravel()])
    if lens is not None:
        points = lens.undistorted(points)
    own = np.linalg.inv(motion) @ np.vstack([points, np.ones(points.shape[1])])
    x, y = (own[:2] / own[2]).reshape(2, *u.shape)
    knobs = [(*place, 0 if twins else kind) for kind, place in enumerate(KNOBS.values())]
    light = gain * _plane(x, y, knobs) + offset + slope * (u - size_px[0] / 2)
    if noise:
        light = light + np.random.default_rng(seed).normal(0.0, noise, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def document_of(names: Sequence[str], **more: object) -> dict[str, Any]:
    """The content of a `panel.yaml` with these knobs as anchors."""
    anchors = [{"name": name, "box": [KNOBS[name][0] - 18, KNOBS[name][1] - 18, 36, 36]} for name in names]
    gauge = {
        "name": "speed",
        "centre": list(GAUGE_PX),
        "radius": [15, 50],
        "sweep": [120, 420],
        "unit": "kt",
        "scale": [[120, 0], [420, 300]],
        "needles": [{"name": "speed_kt", "template": {"at": 360.0, "span": 20}}],
    }
    return {"name": "plane", "picture": "panel.png", "anchors": anchors, "gauges": [gauge], **more}


def panel_of(names: Sequence[str], **more: object) -> Panel:
    """A panel with these knobs as anchors."""
    return parse_panel(yaml.safe_dump(document_of(names, **more)))


def boxes() -> GreyPicture:
    """A picture of the same size full of corners: dark and light boxes in random places."""
    rng = np.random.default_rng(11)
    picture = np.full(SIZE_PX[::-1], 70, np.uint8)
    for _ in range(260):
        x, y = int(rng.integers(SIZE_PX[0])), int(rng.integers(SIZE_PX[1]))
        end = (x + int(rng.integers(6, 40)), y + int(rng.integers(6, 40)))
        cv2.rectangle(picture, (x, y), end, int(rng.integers(20, 240)), -1)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8), np.uint8)


CORNERS = np.stack(np.meshgrid([120.0, 320.0, 520.0], [100.0, 240.0, 380.0])).reshape(2, 9)
"""Places all over the plane, where an alignment is held against the truth."""


def turn(
    *,
    shift_px: tuple[float, float] = (0.0, 0.0),
    roll_deg: float = 0.0,
    scale: float = 1.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    middle_px: tuple[float, float] = (320.0, 240.0),
) -> Matrix:
    """A motion about a middle: `tilt` is by how much a thousand pixels to the right and down come nearer."""
    x, y = middle_px
    cos, sin = scale * math.cos(math.radians(roll_deg)), scale * math.sin(math.radians(roll_deg))
    there = np.array([[1.0, 0.0, x + shift_px[0]], [0.0, 1.0, y + shift_px[1]], [0.0, 0.0, 1.0]])
    own = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [-tilt[0] / 1000, -tilt[1] / 1000, 1.0]])
    back = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, 1.0]])
    return there @ own @ back


def carried(matrix: Matrix, points: Field) -> Field:
    """Where a homography carries (2, N) points."""
    there = matrix @ np.vstack([points, np.ones(points.shape[1])])
    return np.asarray(there[:2] / there[2])


def furthest_px(found: Matrix, truth: Matrix) -> float:
    """How far an alignment is off the truth at the worst of the places, in frame pixels, distortion aside."""
    return float(np.hypot(*(carried(found, CORNERS) - carried(truth, CORNERS))).max())
