"""Tick marks: the angle of the mark next to a click, to some hundredths of a degree."""

from __future__ import annotations

import math

import numpy as np

from decoder.arrays import Floats
from decoder.pictures import GreyPicture
from decoder.setup.drawn_plane import XY, DrawnPlane
from decoder.setup.sampling import sampled_at

# How far from a click its mark may be, and how far around the mark its outline is looked at, pixels along the rim.
REACH_PX = 2.4
OUTLINE_PX = 1.6
# How far beside its mark a click is likely to be: a strong mark further off is a neighbour.
LIKELY_PX = 1.0
# Rings this far to either side of the click are looked at together.
RING_PX = 2.5
STEP_PX = 0.1
ROUNDS = 3
FAINTEST = 0.45
MIN_CONTRAST_LEVELS = 8.0
# The dial itself is seen this far to either side, between other marks; on an arc's end it is not the same on both.
BESIDE_PX = 10.0
DIAL_PERCENTILE = 30.0


def mark_angle_deg(picture: GreyPicture, drawn: DrawnPlane, click: XY) -> float:
    """The angle of the mark next to a click, in [0, 360); of the click itself where there is none.

    Parameters
    ----------
    drawn : the dial's plane
    click : (x, y) px of the picture, on the mark
    """
    clicked_deg, radius_px = drawn.polar(click)
    clicked, radius_px = math.radians(clicked_deg), max(radius_px, 1.0)
    away_px = np.arange(-BESIDE_PX, BESIDE_PX + STEP_PX / 2, STEP_PX)
    angles = clicked + away_px / radius_px
    radii = radius_px + np.linspace(-RING_PX, RING_PX, 9)
    light = _rings(picture, drawn, angles, radii).mean(axis=1)
    contrast = light - np.median(light)
    near = np.where(np.abs(away_px) <= REACH_PX, np.exp(-0.5 * (away_px / LIKELY_PX) ** 2), 0.0)
    best = int((np.abs(contrast) * near).argmax())
    if abs(contrast[best]) < MIN_CONTRAST_LEVELS:
        return math.degrees(clicked) % 360.0
    place = _middle(light * np.sign(contrast[best]), best)
    return math.degrees(float(np.interp(place, np.arange(len(angles)), angles))) % 360.0


def _middle(light: Floats, place: float) -> float:
    """The middle of the bright mark at a place of a ring: each of its edges is where it is half as bright as there."""
    reach, places = round(OUTLINE_PX / STEP_PX), np.arange(len(light))
    for _ in range(ROUNDS):  # the likeliest place is drawn to the click; the outline around it is not
        middle = round(place)
        part = slice(max(middle - reach, 0), middle + reach + 1)
        peak = light[part].max()
        dial = np.where(
            places[part] < place,
            np.percentile(light[: max(middle - reach, 1)], DIAL_PERCENTILE),
            np.percentile(light[min(middle + reach, len(light) - 1) :], DIAL_PERCENTILE),
        )
        weights = np.maximum((light[part] - dial) / np.maximum(peak - dial, 1e-6) - FAINTEST, 0.0)
        place = float(np.average(places[part], weights=weights))
    return place


def _rings(picture: GreyPicture, drawn: DrawnPlane, angles: Floats, radii: Floats) -> Floats:
    """(angles, radii): grey levels of the dial."""
    points = np.stack([np.cos(angles)[:, None] * radii, np.sin(angles)[:, None] * radii])
    x, y = drawn.to_picture(points.reshape(2, -1)).reshape(points.shape)
    return sampled_at(picture, x, y)
