"""A window: four corners around something that is not on a dial, such as a lamp, a display or a straight scale."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from pydantic import TypeAdapter, ValidationError

from decoder.panel.description import Point
from decoder.panel.thresholds import LEAST_WINDOW_PX

Corners = tuple[Point, Point, Point, Point]
"""Clockwise from the top left of what is read."""

# A pixel along a window counts as a degree, so that uncertainties in one are the same in the other.
WINDOW_ARC_PX = math.degrees(1.0)
_CORNERS = TypeAdapter(Corners)
_OF_DIALS = "centre", "radius", "rim", "sweep", "stops", "scale", "wraps", "doubt_deg"


def as_dial(given: dict[Any, Any]) -> dict[Any, Any]:
    """Give a described gauge with a window what the program requires of every dial: a circle around it.

    Raises
    ------
    ValueError
        If it has keys that only dials have.
    """
    if told := [key for key in _OF_DIALS if key in given]:
        raise ValueError(f"has a `window`, and then no `{told[0]}`: its corners say where it is")
    try:
        corners = _CORNERS.validate_python(given["window"])
    except ValidationError:  # which its own field will report
        corners = (0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)
    middle = sum(x for x, _ in corners) / 4, sum(y for _, y in corners) / 4
    reach_px = max(LEAST_WINDOW_PX, *(math.dist(middle, corner) for corner in corners))
    circle = {"centre": middle, "radius": (reach_px / 4, reach_px), "sweep": (0.0, 90.0)}
    return given | circle | {"scale": ((0.0, 0.0), (90.0, 1.0))}


def check_corners(corners: Corners) -> Corners:
    """Raise ValueError unless the corners go clockwise around an area of useful size."""
    ring = [*corners, *corners[:2]]
    turns = [
        (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        for (ax, ay), (bx, by), (cx, cy) in zip(ring, ring[1:], ring[2:], strict=False)
    ]
    if min(turns) <= 0 or min(math.dist(one, other) for one, other in pairwise(ring)) < LEAST_WINDOW_PX:
        raise ValueError(
            f"needs four corners at least {LEAST_WINDOW_PX:g} pixels apart, clockwise from the top left of what is read"
        )
    return corners
