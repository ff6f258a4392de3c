"""Rims: the circle through three clicks, drawn to where the dial's own marks end.

A hand clicks to a pixel, a reading wants the centre to some hundredths. The ring at which tick marks begin or end is
drawn on the dial's own plane, around the needle's pivot; the case before it stands nearer to the camera. So the circle
is fitted to the nearest ring of one kind of edge, over all angles, with outliers (needle, numerals) losing their say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from decoder.arrays import Floats
from decoder.errors import PictureError
from decoder.pictures import GreyPicture
from decoder.setup.sampling import sampled_at

XY = tuple[float, float]

ROUNDS = 12
REACH_PX, LAST_REACH_PX, LESS_PX = 3.0, 1.5, 0.2
STEP_PX = 0.25
ANGLES = 720
FIT_PASSES = 6
# A fit that wanders off further than this has left the ring that was clicked.
MAX_MOVE_PX = 5.0


@dataclass(frozen=True, slots=True)
class Rim:
    """A circle in the picture, pixels."""

    centre: XY
    radius_px: float


def circle_through(points: Sequence[XY]) -> Rim:
    """The circle through three points.

    Raises
    ------
    PictureError
        If they lie on a line, or nearly.
    """
    (ax, ay), (bx, by), (cx, cy) = points
    double_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    longest = max(math.dist(one, other) for one in points for other in points)
    if abs(double_area) < 0.02 * longest**2 + 1e-9:
        raise PictureError("the three points lie on a line; click them round the rim")
    b, c = (bx - ax) ** 2 + (by - ay) ** 2, (cx - ax) ** 2 + (cy - ay) ** 2
    right = ((cy - ay) * b - (by - ay) * c) / (2 * double_area)
    down = ((bx - ax) * c - (cx - ax) * b) / (2 * double_area)
    return Rim((ax + right, ay + down), math.hypot(right, down))


def fitted_rim(picture: GreyPicture, drawn: Rim) -> Rim:
    """The ring of edges next to a drawn circle; the circle itself where there is none."""
    angles = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    design = np.stack([np.cos(angles), np.sin(angles), np.ones(ANGLES)], axis=1)
    rim, sign = drawn, 0.0
    for number in range(ROUNDS):
        reach = max(REACH_PX - LESS_PX * number, LAST_REACH_PX)
        offsets = np.arange(-reach, reach + STEP_PX / 2, STEP_PX)
        slopes = _slopes(picture, rim, design, offsets)
        if not sign:
            near = np.exp(-((offsets / LAST_REACH_PX) ** 2))
            sign = float(np.sign((np.sign(slopes) * slopes**2 * near).sum())) or 1.0
        wanted = np.maximum(slopes * sign, 0.0) * np.exp(-2.0 * (offsets / reach) ** 2)
        moved = _moved(rim, design, offsets, wanted**2)
        if moved is None or math.dist(moved.centre, drawn.centre) > MAX_MOVE_PX:
            return drawn
        rim = moved
    return rim if abs(rim.radius_px - drawn.radius_px) <= MAX_MOVE_PX else drawn


def _slopes(picture: GreyPicture, rim: Rim, design: Floats, offsets: Floats) -> Floats:
    """(angles, offsets): how fast the picture brightens outwards."""
    radii = rim.radius_px + offsets
    x = rim.centre[0] + design[:, :1] * radii
    y = rim.centre[1] + design[:, 1:2] * radii
    smooth = cv2.GaussianBlur(sampled_at(picture, x, y), (5, 1), 0)
    slopes: Floats = np.gradient(smooth, axis=1)
    return slopes


def _moved(rim: Rim, design: Floats, offsets: Floats, energy: Floats) -> Rim | None:
    total = energy.sum(axis=1)
    if not total.max() > 1.0:
        return None
    place = (energy * offsets).sum(axis=1) / np.maximum(total, 1e-6)
    base = np.minimum(total, np.percentile(total, 80))
    weights = base
    for _ in range(FIT_PASSES):
        weighted = design * weights[:, None]
        step = np.linalg.lstsq(design.T @ weighted, weighted.T @ place, rcond=None)[0]
        left = design @ step - place
        spread = math.sqrt(float(np.average(left**2, weights=weights))) + 0.05
        weights = base / (1.0 + (left / spread) ** 2) ** 2
    right, down, wider = (float(value) for value in step)
    return Rim((rim.centre[0] + right, rim.centre[1] + down), rim.radius_px + wider)
