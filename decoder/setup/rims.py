"""Rims: the circle through a few clicks on a dial, drawn to where the dial's own marks end.

A hand clicks to a pixel, a reading wants the centre to some hundredths. The ring at which tick marks begin or end is
drawn on the dial's own plane, around the needle's pivot; the case before it stands nearer to the camera. So the circle
is fitted to the nearest ring of one kind of edge, over all angles, with outliers (needle, numerals) losing their say.
Seen from the side the ring is an ellipse: its shape follows from the dial's plane where that is known, and is fitted
where it is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats
from decoder.dial_plane import DialPlane
from decoder.errors import PictureError
from decoder.pictures import GreyPicture
from decoder.setup.drawn_plane import XY, DrawnPlane
from decoder.setup.sampling import sampled_at

ROUNDS = 12
REACH_PX, LAST_REACH_PX, LESS_PART = 3.0, 1.5, 0.2 / 3.0
# On a large dial a hand is seldom nearer to the ring than such a part of its radius.
REACH_PART = 0.04
STEP_PX = 0.25
ANGLES = 720
FIT_PASSES = 6
BEND_PASSES = 12
# A fit that wanders off further than this has left the ring that was clicked.
MAX_MOVE_PX = 5.0
# A dial seen from 70 degrees beside its axis.
MAX_FLATNESS = 0.66


class Freedom(IntEnum):
    """What of a ring is fitted, by how many numbers that takes."""

    CIRCLE = 3
    """Place and size, in the plane that it has."""
    ELLIPSE = 5
    """Its shape as well."""


@dataclass(frozen=True, slots=True)
class Ring:
    """A circle on the dial's plane around its pivot; `miss_px` is how far the edges stand from it, typically."""

    drawn: DrawnPlane
    radius_px: float
    miss_px: float = math.inf

    @property
    def centre(self) -> XY:
        """The pivot in the picture."""
        return self.drawn.centre

    def stepped(self, step: Floats) -> Ring:
        """The ring whose edge lies further out by a Fourier series of the angle: cos, sin, 1, perhaps cos 2, sin 2."""
        right, down, wider = (float(each) for each in step[:3])
        along, across = (
            (float(each) / self.radius_px for each in step[3:]) if len(step) > Freedom.CIRCLE else (0.0, 0.0)
        )
        change = np.array([[1 + along, across, right], [across, 1 - along, down], [0.0, 0.0, 1.0]])
        plane = DialPlane.of(self.drawn.plane.matrix @ change)
        return Ring(DrawnPlane(plane, self.drawn.lens), self.radius_px + wider, self.miss_px)

    @property
    def flatness(self) -> float:
        """How much shorter its short axis is in the picture than its long one, as a part of that."""
        away = self.drawn.ring(self.radius_px) - np.array(self.centre)[:, None]
        long, short = np.sqrt(np.linalg.eigvalsh(away @ away.T)[::-1])
        return 1.0 - float(short / long)


def circle_through(drawn: DrawnPlane, points: Sequence[XY]) -> Ring:
    """The circle on a plane through three places in the picture; the plane is moved to its centre.

    Raises
    ------
    PictureError
        If they lie on a line, or nearly.
    """
    places = drawn.to_dial(np.array(points, np.float64).T).T.tolist()
    (ax, ay), (bx, by), (cx, cy) = places
    double_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    longest = max(math.dist(one, other) for one in places for other in places)
    if abs(double_area) < 0.02 * longest**2 + 1e-9:
        raise PictureError("the three points lie on a line; click them round the rim")
    b, c = (bx - ax) ** 2 + (by - ay) ** 2, (cx - ax) ** 2 + (cy - ay) ** 2
    right = ((cy - ay) * b - (by - ay) * c) / (2 * double_area)
    down = ((bx - ax) * c - (cx - ax) * b) / (2 * double_area)
    around = DrawnPlane(drawn.plane.around((ax + right, ay + down)), drawn.lens)
    return Ring(around, math.hypot(right, down))


def bent(ring: Ring, points: Sequence[XY]) -> Ring:
    """The ellipse through clicks: with five or more the one that fits best, with fewer the most like `ring`.

    Raises
    ------
    PictureError
        If there is none.
    """
    places = np.array(points, np.float64).T
    found = ring
    for _ in range(BEND_PASSES):
        seen = found.drawn.to_dial(places)
        further = np.hypot(*seen) - found.radius_px
        step = np.linalg.lstsq(_design(np.arctan2(seen[1], seen[0]), Freedom.ELLIPSE), further, rcond=1e-4)[0]
        found = found.stepped(np.clip(step, -0.3 * found.radius_px, 0.3 * found.radius_px))
        if not np.isfinite(found.drawn.plane.matrix).all() or found.radius_px <= 1.0 or found.flatness > MAX_FLATNESS:
            raise PictureError("no ellipse goes through these points; click them all round the rim")
    return found


def fitted_ring(picture: GreyPicture, drawn: Ring, freedom: Freedom) -> Ring:
    """The ring of edges next to a drawn one; that itself where there is none."""
    angles = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    design = _design(angles, freedom)
    ring, sign = drawn, 0.0
    for number in range(ROUNDS):
        reach = max(max(REACH_PX, REACH_PART * drawn.radius_px) * (1.0 - LESS_PART * number), LAST_REACH_PX)
        offsets = np.arange(-reach, reach + STEP_PX / 2, STEP_PX)
        slopes = _slopes(picture, ring, angles, offsets)
        if not sign:
            near = np.exp(-((offsets / LAST_REACH_PX) ** 2))
            sign = float(np.sign((np.sign(slopes) * slopes**2 * near).sum())) or 1.0
        wanted = np.maximum(slopes * sign, 0.0) * np.exp(-2.0 * (offsets / reach) ** 2)
        moved = _moved(ring, design, offsets, wanted**2)
        if moved is None or math.dist(moved.centre, drawn.centre) > MAX_MOVE_PX:
            return drawn
        ring = moved
    return ring if abs(ring.radius_px - drawn.radius_px) <= MAX_MOVE_PX else drawn


def _design(angles: Floats, freedom: Freedom) -> NDArray[np.float64]:
    """(N, freedom): how far out each number of a step moves the edge at each angle."""
    columns = [np.cos(angles), np.sin(angles), np.ones_like(angles), np.cos(2 * angles), np.sin(2 * angles)]
    return np.stack(columns[:freedom], axis=1)


def _slopes(picture: GreyPicture, ring: Ring, angles: Floats, offsets: Floats) -> Floats:
    """(angles, offsets): how fast the picture brightens outwards."""
    radii = ring.radius_px + offsets
    points = np.stack([np.cos(angles)[:, None] * radii, np.sin(angles)[:, None] * radii])
    x, y = ring.drawn.to_picture(points.reshape(2, -1)).reshape(points.shape)
    smooth = cv2.GaussianBlur(sampled_at(picture, x, y), (5, 1), 0)
    slopes: Floats = np.gradient(smooth, axis=1)
    return slopes


def _moved(ring: Ring, design: Floats, offsets: Floats, energy: Floats) -> Ring | None:
    total = energy.sum(axis=1)
    if not total.max() > 1.0:
        return None
    place = (energy * offsets).sum(axis=1) / np.maximum(total, 1e-6)
    base = np.minimum(total, np.percentile(total, 80))
    weights = base
    spread = math.inf
    for _ in range(FIT_PASSES):
        weighted = design * weights[:, None]
        step = np.linalg.lstsq(design.T @ weighted, weighted.T @ place, rcond=None)[0]
        left = design @ step - place
        spread = math.sqrt(float(np.average(left**2, weights=weights)))
        weights = base / (1.0 + (left / (spread + 0.05)) ** 2) ** 2
    moved = ring.stepped(step)
    return Ring(moved.drawn, moved.radius_px, spread)
