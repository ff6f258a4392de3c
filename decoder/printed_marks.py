"""Printed marks: how well a panel's scale agrees with the marks that are printed on its dial.

Somebody drew the scale on the panel picture, by hand or with help. Where the printed marks lie is measured in the same
picture, to a hundredth of a pixel or two: the distance between both is how precisely the panel was drawn, and so a part
of every reading's uncertainty. Scales that do not follow the marks (some are calibrated otherwise) tell nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats, Mask
from decoder.pictures import GreyPicture
from decoder.resampling import PointMap
from decoder.sorting import median_of, middle_of
from decoder.unwrapping import PolarGrid

# Marks lie on the needle's way or just outside of it, by parts of the gauge's outer radius.
FIRST_PART, LAST_PART = 0.6, 1.25
STEP_PX = 0.4
RING_PX = 1.5
# How far from where it is drawn a mark may be; and where its own dial is seen to either side of it.
REACH_PX = 1.2
WITHIN_PX = 0.6
BESIDE_PX = (2.2, 3.5)
OUTLINE_PX = 2.2
FAINTEST = 0.3
MIN_CONTRAST_LEVELS = 8.0
# Rings in which marks stand out by half of what they do at best.
RING_PART = 0.5
MIN_MARKS = 3
FOUND_PART = 2 / 3
# Marks of the scale lie as near as this to where it is drawn; what is further away is there by chance.
MAX_OFF_PX = 0.4
MAD_TO_SIGMA = 1.4826


def marks_off_deg(angles_deg: Sequence[float], outer_px: float, grid: PolarGrid, drawn_on: GreyPicture,
                  own: Alignment) -> Floats:  # fmt: skip
    """(N,): how far beyond the drawn angles the printed marks lie; NaN where there is none.

    Parameters
    ----------
    angles_deg
        Of the scale, N.
    outer_px
        The gauge's outer radius.
    grid
        The gauge's: its centre and its plane are taken over.
    drawn_on, own
        The panel picture, and its alignment with itself as taken.
    """
    reach = math.ceil((BESIDE_PX[1] + RING_PX) / STEP_PX)
    away_px = np.arange(-reach, reach + 1) * STEP_PX
    step_deg = math.degrees(STEP_PX / outer_px)
    inner_px = FIRST_PART * outer_px
    rings = max(round((LAST_PART - FIRST_PART) * outer_px / RING_PX), 2)
    around_deg = np.array(angles_deg)[:, None] + step_deg * np.arange(-reach, reach + 1)
    points = grid.points_at(around_deg.ravel(), inner_px + RING_PX * np.arange(rings))
    seen = PointMap.of([points.reshape(2, -1)]).sample(drawn_on, own).reshape(*around_deg.shape, rings)
    light = seen[:, :, _rings_of_marks(seen, away_px)]
    if not light.shape[2]:
        return np.full(len(angles_deg), np.nan)
    off_deg: Floats = np.degrees(_middles_px(light.mean(axis=2), away_px) / outer_px)
    return off_deg


def drawn_to_deg(off_deg: Floats, outer_px: float) -> float | None:
    """How precisely a scale is drawn, as a standard uncertainty; None if its marks do not tell."""
    found = off_deg[np.isfinite(off_deg)]
    if len(found) < max(MIN_MARKS, FOUND_PART * len(off_deg)):
        return None
    sigma_deg = MAD_TO_SIGMA * float(middle_of(np.abs(found)))
    return sigma_deg if sigma_deg <= math.degrees(MAX_OFF_PX / outer_px) else None


def _rings_of_marks(seen: Floats, away_px: Floats) -> Mask:
    """(rings,) bool: where most marks are brighter, or darker, than the dial to both sides of them."""
    first, last = BESIDE_PX
    at = seen[:, np.abs(away_px) <= WITHIN_PX].mean(axis=1)
    before = at - seen[:, (away_px <= -first) & (away_px >= -last)].mean(axis=1)
    behind = at - seen[:, (away_px >= first) & (away_px <= last)].mean(axis=1)
    stands_out = np.where(before * behind > 0, np.minimum(np.abs(before), np.abs(behind)), 0.0)
    strength = median_of(stands_out)
    chosen: Mask = strength > max(MIN_CONTRAST_LEVELS, RING_PART * float(strength.max()))
    return chosen


def _middles_px(light: Floats, away_px: Floats) -> Floats:
    """(N,): the middle of each mark's outline, by its light, (N, samples); NaN without a mark."""
    contrast = np.abs(light - median_of(light.T)[:, None])
    best = np.where(np.abs(away_px) <= REACH_PX, contrast, 0.0).argmax(axis=1)
    clearest = np.take_along_axis(contrast, best[:, None], axis=1)
    outline = np.abs(away_px - away_px[best][:, None]) <= OUTLINE_PX
    weights = np.maximum(contrast - FAINTEST * clearest, 0.0) * outline
    middles: Floats = (weights * away_px).sum(axis=1) / np.maximum(weights.sum(axis=1), 1e-9)
    return np.where(clearest[:, 0] >= MIN_CONTRAST_LEVELS, middles, np.nan)
