"""Tick marks: the angle of the mark next to a click, to some hundredths of a degree."""

from __future__ import annotations

import math

import numpy as np

from decoder.pictures import GreyPicture
from decoder.setup.rims import XY
from decoder.setup.sampling import sampled_at

# How far from a click its mark may be, and how far around the mark its outline is looked at, pixels along the rim.
REACH_PX = 2.4
OUTLINE_PX = 1.6
# Rings this far to either side of the click are looked at together.
RING_PX = 1.5
STEP_PX = 0.1
FAINTEST = 0.3
MIN_CONTRAST_LEVELS = 8.0
# Marks take up less than half of the ring, so its median this far around is the dial.
BESIDE_PX = 10.0


def mark_angle_deg(picture: GreyPicture, centre: XY, click: XY) -> float:
    """The angle of the mark next to a click, in [0, 360); of the click itself where there is none.

    Parameters
    ----------
    centre : (x, y) px, of the dial
    click : (x, y) px, on the mark
    """
    radius_px = max(math.dist(centre, click), 1.0)
    clicked = math.atan2(click[1] - centre[1], click[0] - centre[0])
    away_px = np.arange(-REACH_PX - OUTLINE_PX, REACH_PX + OUTLINE_PX + STEP_PX / 2, STEP_PX)
    angles = clicked + away_px / radius_px
    radii = radius_px + np.linspace(-RING_PX, RING_PX, 7)
    x = centre[0] + np.cos(angles)[:, None] * radii
    y = centre[1] + np.sin(angles)[:, None] * radii
    light = sampled_at(picture, x, y).mean(axis=1)
    beside = clicked + np.arange(-BESIDE_PX, BESIDE_PX + 0.5) / radius_px
    level = np.median(sampled_at(picture, centre[0] + np.cos(beside)[:, None] * radii,
                                 centre[1] + np.sin(beside)[:, None] * radii))  # fmt: skip
    contrast = np.abs(light - level)
    best = int(np.where(np.abs(away_px) <= REACH_PX, contrast, 0.0).argmax())
    if contrast[best] < MIN_CONTRAST_LEVELS:
        return math.degrees(clicked) % 360.0
    reach = round(OUTLINE_PX / STEP_PX)
    part = slice(max(best - reach, 0), best + reach + 1)
    weights = np.maximum(contrast[part] - FAINTEST * contrast[best], 0.0)
    return math.degrees(float(np.average(angles[part], weights=weights))) % 360.0
