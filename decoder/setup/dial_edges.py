"""Edges of a dial near clicks on it, to a fraction of a pixel: rims on which its marks end, and tick marks.

People click to a pixel, but readings need the centre to some hundredths. The ring at which tick marks begin or end is
drawn on the dial's own plane, around the needle's pivot; the case in front of it is nearer to the camera. So the circle
is fitted to the nearest ring of one kind of edge, over all angles, robust against outliers (needle, numerals). Seen
from the side the ring is an ellipse: its shape follows from the dial's plane if that is known, and is fitted if it is
not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import DialPlane
from decoder.imaging.resampling import levels_at
from decoder.imaging.thresholds import HALF
from decoder.learning.obliqueness import USUAL_LENS, squeeze_shown
from decoder.learning.thresholds import MOST_MARK_PART
from decoder.panel.arrays import Floats
from decoder.panel.errors import PictureError
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.registration.thresholds import NOISE_LEVELS
from decoder.setup.drawn_plane import XY, DrawnPlane, Planes, mean_radius_px, rim_of
from decoder.setup.thresholds import (
    CLEARLY_NEARER,
    MAX_FLATNESS,
    MAX_MOVE_PX,
)

# How far around a mark its outline is sampled, along the rim.
OUTLINE_PX = 1.6
# How far from its mark a click is likely to be: a strong mark further off is a neighbour.
LIKELY_PX = 1.0
# Rings this far to either side of the click are used together.
RING_PX = 2.5
MARK_STEP_PX = 0.1
MARK_ROUNDS = 3
# The dial itself is sampled this far to either side, between other marks; at an arc's end its sides differ.
BESIDE_PX = 10.0
DIAL_PERCENTILE = 30.0

ROUNDS = 12
LAST_REACH_PX = 1.5
STEP_PX = 0.25
ANGLES = 720
FIT_PASSES = 6
BEND_PASSES = 12


def sampled_at(picture: GreyPicture, x: Floats, y: Floats) -> Floats:
    """Sample grey levels at points, bilinear, in the shape of `x` and `y`; outside, the picture's border.

    Only the part around the points is accessed, so that a picture of 18 megapixels costs no more than its dial.
    """
    height, width = picture.shape
    left, top = (max(int(np.floor(values.min())) - 2, 0) for values in (x, y))
    left, top = min(left, width - 1), min(top, height - 1)
    right, bottom = (int(np.ceil(values.max())) + 3 for values in (x, y))
    patch = picture[top : max(bottom, top + 1), left : max(right, left + 1)].astype(np.float32)
    return levels_at(patch, np.stack([x - left, y - top], axis=-1).astype(np.float32)).reshape(x.shape)


def mark_angle_deg(picture: GreyPicture, drawn: DrawnPlane, click: XY) -> float:
    """Find the angle of the mark nearest to a click, in [0, 360); that of the click itself if there is none.

    Parameters
    ----------
    drawn : the dial's plane
    click : (x, y) px of the picture, on the mark
    """
    clicked_deg, radius_px = drawn.polar(click)
    clicked, radius_px = math.radians(clicked_deg), max(radius_px, 1.0)
    away_px = np.arange(-BESIDE_PX, BESIDE_PX + MARK_STEP_PX / 2, MARK_STEP_PX)
    angles = clicked + away_px / radius_px
    radii = radius_px + np.linspace(-RING_PX, RING_PX, 9)
    light = levels_on_rings(picture, drawn, angles, radii).mean(axis=1)
    contrast = light - np.median(light)
    near = np.exp(-0.5 * (away_px / LIKELY_PX) ** 2)
    best = int((np.abs(contrast) * near).argmax())
    if abs(contrast[best]) < 2 * NOISE_LEVELS:
        return math.degrees(clicked) % 360.0
    place = _middle(light * np.sign(contrast[best]), best)
    return math.degrees(float(np.interp(place, np.arange(len(angles)), angles))) % 360.0


def _middle(light: Floats, place: float) -> float:
    """Find the middle of the bright mark at a place of a ring: each edge is where it is half as bright."""
    reach, places = round(OUTLINE_PX / MARK_STEP_PX), np.arange(len(light))
    beside: dict[int, Floats] = {}
    for _ in range(MARK_ROUNDS):  # the likeliest place is biased towards the click; the outline around it is not
        middle = round(place)
        part = slice(max(middle - reach, 0), middle + reach + 1)
        peak = light[part].max()
        if middle not in beside:
            sides = light[: max(middle - reach, 1)], light[min(middle + reach, len(light) - 1) :]
            beside[middle] = np.array([np.percentile(side, DIAL_PERCENTILE) for side in sides])
        dial = np.where(places[part] < place, *beside[middle])
        weights = np.maximum((light[part] - dial) / np.maximum(peak - dial, 1e-6) - HALF, 0.0)
        if not weights.any():  # its surroundings are no darker, so there is no outline to refine it
            return place
        place = float(np.average(places[part], weights=weights))
    return place


def levels_on_rings(picture: GreyPicture, drawn: DrawnPlane, angles: Floats, radii: Floats) -> Floats:
    """(angles, radii): grey levels of the dial."""
    points = np.stack([np.cos(angles)[:, None] * radii, np.sin(angles)[:, None] * radii])
    x, y = drawn.to_picture(points.reshape(2, -1)).reshape(points.shape)
    return sampled_at(picture, x, y)


class Freedom(IntEnum):
    """Which parameters of a ring are fitted; the value is their number."""

    CIRCLE = 3
    """Place and size, in the plane that it has."""
    ELLIPSE = 5
    """Its shape as well."""


@dataclass(frozen=True, slots=True)
class Ring:
    """A circle on the dial's plane around its pivot; `miss_px` is the typical distance of the edges from it."""

    drawn: DrawnPlane
    radius_px: float
    miss_px: float = math.inf

    @property
    def centre(self) -> XY:
        """The pivot in the picture."""
        return self.drawn.centre

    def stepped(self, step: Floats) -> Ring:
        """Move the edge of a ring outwards by a Fourier series of the angle: cos, sin, 1, maybe cos 2, sin 2."""
        right, down, wider = (float(each) for each in step[:3])
        along, across = (
            (float(each) / self.radius_px for each in step[3:]) if len(step) > Freedom.CIRCLE else (0.0, 0.0)
        )
        change = np.array([[1 + along, across, right], [across, 1 - along, down], [0.0, 0.0, 1.0]])
        plane = DialPlane.of(self.drawn.plane.matrix @ change)
        return Ring(DrawnPlane(plane, self.drawn.lens), self.radius_px + wider, self.miss_px)

    @property
    def flatness(self) -> float:
        """How much shorter its minor axis is in the picture than its major one, relative to that."""
        away = self.drawn.ring(self.radius_px) - np.array(self.centre)[:, None]
        long, short = np.sqrt(np.linalg.eigvalsh(away @ away.T)[::-1])
        return 1.0 - float(short / long)


def circle_through(drawn: DrawnPlane, points: Sequence[XY]) -> Ring:
    """Make the circle on a plane through three places in the picture; the plane is moved to its centre.

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
    return Ring(drawn.moved(ax + right, ay + down), math.hypot(right, down))


def bent(ring: Ring, points: Sequence[XY]) -> Ring:
    """Deform a ring to pass through clicks: with five or more the best fit, with fewer as little as possible.

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
        step = np.linalg.lstsq(ring_design(np.arctan2(seen[1], seen[0]), Freedom.ELLIPSE), further, rcond=1e-4)[0]
        found = found.stepped(np.clip(step, -0.3 * found.radius_px, 0.3 * found.radius_px))
        if not np.isfinite(found.drawn.plane.matrix).all() or found.radius_px <= 1.0 or found.flatness > MAX_FLATNESS:
            raise PictureError("no ellipse goes through these points; click them all round the rim")
    return found


def fitted_ring(picture: GreyPicture, drawn: Ring, freedom: Freedom) -> Ring:
    """Fit a drawn ring to the nearest edges; it stays if there are none."""
    angles = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    design = ring_design(angles, freedom)
    ring, sign = drawn, 0.0
    for reach in np.linspace(MAX_MOVE_PX, LAST_REACH_PX, ROUNDS):
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


def ring_design(angles: Floats, freedom: Freedom) -> NDArray[np.float64]:
    """(N, freedom): how far out each parameter of a step moves the edge at each angle."""
    columns = [np.cos(angles), np.sin(angles), np.ones_like(angles), np.cos(2 * angles), np.sin(2 * angles)]
    return np.stack(columns[:freedom], axis=1)


def _slopes(picture: GreyPicture, ring: Ring, angles: Floats, offsets: Floats) -> Floats:
    """(angles, offsets): how fast the picture brightens outwards."""
    levels = levels_on_rings(picture, ring.drawn, angles, ring.radius_px + offsets)
    smooth = cv2.GaussianBlur(levels, (5, 1), 0)
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


@dataclass(frozen=True, slots=True)
class Rim:
    """The rim of a gauge.

    Attributes
    ----------
    centre
        The pivot in the picture, pixels.
    radius_px
        In the dial's plane.
    points
        For the gauge's `rim`, if its plane does not follow from elsewhere.
    drawn
        The resulting plane of the gauge.
    """

    centre: XY
    radius_px: float
    points: list[list[float]] | None
    drawn: DrawnPlane


def oblique_rim(planes: Planes, drawn: DrawnPlane, radius_px: float) -> Rim:
    """Make the rim of a gauge of a circle on a plane that follows from the rim alone."""
    points = rim_of(drawn, radius_px)
    return Rim(drawn.centre, radius_px, points, planes.drawn(drawn.centre, points))


def begun(picture: GreyPicture, planes: Planes, clicks: Sequence[XY]) -> Rim:
    """Find the rim meant by three clicks: a circle on the known plane, else a circle or a clear ellipse.

    Raises
    ------
    PictureError
        If they lie on a line.
    """
    circle = fitted_ring(picture, circle_through(planes.drawn(clicks[0]), clicks), Freedom.CIRCLE)
    if planes.inches is None:
        ellipse = fitted_ring(picture, circle, Freedom.ELLIPSE)
        if ellipse.flatness < MAX_FLATNESS and ellipse.miss_px < CLEARLY_NEARER * circle.miss_px:
            return _kept(planes, ellipse, oblique=True)
    return _kept(planes, circle, oblique=False)


def centre_doubt_px(picture: GreyPicture, planes: Planes, clicks: Sequence[XY]) -> float:
    """Estimate how far off three clicks on a rim may leave its centre, with the usual confidence.

    Each may be slightly off; and where the plane is unknown, the dial may be seen from aside, as its circles show. Its
    hub then does not appear in the middle of the circle through three places of an ellipse, nor quite in the ellipse's.

    Raises
    ------
    PictureError
        If they lie on a line.
    """
    circle = circle_through(planes.drawn(clicks[0]), clicks)
    across, along = circle.drawn.to_dial(np.array(clicks, np.float64).T)
    design = ring_design(np.arctan2(along, across), Freedom.CIRCLE)
    covariance = np.linalg.inv(design.T @ design)
    clicked_px = CONFIDENCE_SIGMAS * LIKELY_PX * math.sqrt(float(np.trace(covariance[:2, :2])))
    return math.hypot(clicked_px, _aside_px(picture, planes, clicks, circle))


def _aside_px(picture: GreyPicture, planes: Planes, clicks: Sequence[XY], circle: Ring) -> float:
    """Estimate how far off the centre of a circle through clicks is if the dial is seen as its circles show."""
    if planes.inches is not None:
        return 0.0
    (width, _), centre = planes.optics.size_px, np.array(circle.centre)
    squeeze = squeeze_shown(picture, planes.optics, centre, circle.radius_px)
    if squeeze.part <= MOST_MARK_PART:
        return 0.0
    matrix = np.eye(3)
    matrix[:2] = np.column_stack([squeeze.matrix, centre])
    moved_px = math.dist(circle_through(DrawnPlane(DialPlane.of(matrix)), clicks).centre, circle.centre)
    return moved_px + circle.radius_px**2 * squeeze.obliqueness / (width * math.exp(USUAL_LENS[0]))


def around_hub(planes: Planes, clicks: Sequence[XY], hub: XY) -> Rim:
    """Make the circle around a hub that best fits the clicks."""
    drawn = planes.drawn(hub)
    return _kept(planes, Ring(drawn, mean_radius_px(drawn, np.array(clicks, np.float64).T)), oblique=False)


def refined(picture: GreyPicture, planes: Planes, ring: Ring, clicks: Sequence[XY]) -> Rim:
    """Deform a rim to pass through clicks, and fit it to the marks there.

    Raises
    ------
    PictureError
        If there is none.
    """
    ellipse = fitted_ring(picture, bent(ring, clicks), Freedom.ELLIPSE)
    if ellipse.radius_px <= 1.0:
        raise PictureError("no ellipse goes through these points; click them all round the rim")
    return _kept(planes, ellipse, oblique=True)


def _kept(planes: Planes, ring: Ring, *, oblique: bool) -> Rim:
    """Reduce a ring to what a gauge stores: its plane is the one that follows from that."""
    points = rim_of(ring.drawn, ring.radius_px) if oblique else None
    centre = ring.centre
    drawn = planes.drawn(centre, points)
    return Rim(centre, mean_radius_px(drawn, ring.drawn.ring(ring.radius_px)), points, drawn)
