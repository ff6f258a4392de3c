"""Marks of gauges whose centres are drawn far beside where needles turn: points, or angles.

Somebody who clicks on a mark, and on a wrong centre, gives the mark's direction from that centre: around the right one
it lies elsewhere, by up to half a degree for each hundredth of the radius. Somebody who reads angles off the dial gives
them right. A panel does not say which; its needles do. Each is drawn where the panel picture shows it, as seen from
one centre or the other, and one hand drew them all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from decoder.learning.pivot_path import PivotPath, Vector
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG

# How precisely needles are drawn by an ordinary hand, and seen in the panel picture.
ANGLE_DEG = 1.5
# Angles are likelier before needles tell: those of a needle above its dial are right, too, and it turns elsewhere.
PRIOR_LOG_ODDS = -3.0

Seen = Sequence[tuple[float, float]]
"""Of a gauge's needles: at which angle each is drawn, and where the panel picture shows it around its pivot."""


def log_odds_of_points(gauges: Sequence[Gauge], paths: Sequence[PivotPath], seen: Sequence[Seen]) -> float:
    """Tell how likely a panel's marks are points that were seen from its centres, and not angles, by its needles.

    Needles of gauges whose centres are right tell how precisely all of them are drawn and seen.
    """
    beside_deg = [
        (path, _short_way(seen_deg - drawn_deg), seen_from(path.far_px, gauge.radius[1], drawn_deg) - drawn_deg)
        for gauge, path, own in zip(gauges, paths, seen, strict=True)
        for drawn_deg, seen_deg in own
    ]
    right_deg = [abs(off_deg) for path, off_deg, _ in beside_deg if not path.is_far]
    spread_deg = math.hypot(ANGLE_DEG, float(np.median(right_deg)) if right_deg else 0.0)
    return PRIOR_LOG_ODDS + sum(
        log_odds_of_point(off_deg / spread_deg, moved_deg / spread_deg)
        for path, off_deg, moved_deg in beside_deg
        if path.is_far
    )


def log_odds_of_point(off: float, moved: float) -> float:
    """Weigh a needle that is seen so far beside where it is drawn, if a point would have moved by `moved`; in spreads.

    Errors of drawing are taken for a Cauchy distribution's: one needle that is drawn quite wrongly decides nothing.
    """
    return math.log((1.0 + off**2) / (1.0 + (off - moved) ** 2))


def seen_from(offset_px: Vector, radius_px: float, angle_deg: float) -> float:
    """Tell the angle of a point from elsewhere, in the same turn.

    Parameters
    ----------
    offset_px
        Of the place it is seen from, (x, y) from the centre.
    radius_px, angle_deg
        Of the point, around the centre.
    """
    angle = math.radians(angle_deg)
    x, y = radius_px * math.cos(angle) - offset_px[0], radius_px * math.sin(angle) - offset_px[1]
    return angle_deg + _short_way(math.degrees(math.atan2(y, x)) - angle_deg)


def _short_way(angle_deg: float) -> float:
    return (angle_deg + FULL_CIRCLE_DEG / 2) % FULL_CIRCLE_DEG - FULL_CIRCLE_DEG / 2


def seen_from_pivots(gauges: Sequence[Gauge], paths: Sequence[PivotPath], log_odds: float) -> tuple[Gauge, ...]:
    """Tell drawn gauges' angles around their pivots, if they are rather points around the centres that are drawn."""
    if log_odds <= 0.0:
        return tuple(gauges)
    return tuple(
        gauge.at_angles(partial(seen_from, path.beside_px, gauge.radius[1])) if path.was_moved else gauge
        for gauge, path in zip(gauges, paths, strict=True)
    )
