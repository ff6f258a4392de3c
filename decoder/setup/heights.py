"""How high a needle turns above its face, told by how far beside its pivot it seems to turn when seen from the side."""

from __future__ import annotations

import math

import numpy as np

from decoder.dial_plane import inches_to_picture
from decoder.panel_pictures import PanelPictures
from decoder.parallax import Raised
from decoder.plane_fit import carried
from decoder.setup.drawn_plane import XY

# A needle this high shows how a picture displaces needles.
TRIED_INCHES = 0.1
# Seen from less beside its axis than this, an inch of height displaces too little to be told from a badly drawn centre.
LEAST_PX_PER_INCH = 4.0
LEAST_INCHES, MOST_INCHES = 0.01, 0.5
# What is left of the displacement when the height is allowed for must be this small a part of it.
MOST_LEFT = 0.35


def height_inches(source: PanelPictures, moved_px: XY | None) -> float | None:
    """The height that explains where the needles of the only gauge turn; None where none does, or it is said already.

    Parameters
    ----------
    source : a panel of one gauge
    moved_px : from the gauge's centre to where its needles turn, in the panel picture
    """
    (gauge,) = source.panel.gauges
    optics = source.optics
    inches = inches_to_picture(source.panel, optics)
    if moved_px is None or gauge.needle_height_inches or inches is None or optics.lens is None:
        return None
    foot = np.array(gauge.centre, np.float64)[:, None]
    raised = Raised(TRIED_INCHES, tuple((inches / inches[2, 2]).ravel().tolist())).seen_in(optics.own)
    straight = np.asarray(optics.straight(foot), np.float64)
    right, down = (float(each) / TRIED_INCHES for each in (carried(raised, straight) - straight)[:, 0])
    px_per_inch = math.hypot(right, down)
    if px_per_inch < LEAST_PX_PER_INCH:
        return None
    height = (moved_px[0] * right + moved_px[1] * down) / px_per_inch**2
    left_px = math.hypot(moved_px[0] - height * right, moved_px[1] - height * down)
    if not LEAST_INCHES <= height <= MOST_INCHES or left_px > MOST_LEFT * math.hypot(*moved_px):
        return None
    return round(height, 3)
