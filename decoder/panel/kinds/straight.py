"""Places along a straight window, as `panel.yaml` gives them: points of the panel picture, or its x or y alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field

from decoder.panel.arrays import Number, at_most

# As in `decoder.panel.description`, which knows how whole files are read.
Pixels = Annotated[Number, at_most(1e5)]
Point = tuple[Pixels, Pixels]
Corners = tuple[Point, Point, Point, Point]

Place = Pixels | Point
"""A point of the panel picture; or its x where things move across the window, its y where they move down."""


def _of_one_kind(marks: tuple[tuple[Place, float], ...]) -> tuple[tuple[Place, float], ...]:
    if len({isinstance(place, tuple) for place, _ in marks}) > 1:
        raise ValueError("needs either points or single pixels, not both")
    return marks


PlacedMarks = Annotated[
    tuple[tuple[Place, Number], ...], Field(min_length=2, max_length=1000), AfterValidator(_of_one_kind)
]

Way = Literal["down", "across"]
"""Along which sides of its window something moves."""
ACROSS: Way = "across"
WAYS: tuple[Way, ...] = get_args(Way)


def places_px(way: Way, corners: Corners, place: Place) -> tuple[float, float]:
    """Return how far along and across a window a place lies, pixels from its first corner."""
    if isinstance(place, tuple):
        point = place
    else:
        x, y = (sum(corner[axis] for corner in corners) / len(corners) for axis in (0, 1))
        point = (place, y) if way == ACROSS else (x, place)
    (across, down), (width_px, height_px) = to_window(corners, point), size_px(corners)
    both = across * width_px, down * height_px
    return both if way == ACROSS else both[::-1]


def length_px(way: Way, corners: Corners) -> float:
    """Return how long a window is the way that something moves."""
    width_px, height_px = size_px(corners)
    return width_px if way == ACROSS else height_px


def corners_of(window: tuple[tuple[float, float], ...] | None) -> Corners:
    """Return the corners of a gauge that is read in a window."""
    if window is None:
        raise AssertionError("what is read along a window has one")
    one, two, three, four = window
    return one, two, three, four


def size_px(corners: Sequence[Point]) -> tuple[float, float]:
    """Return width and height: the mean length of the sides across and of those down."""
    top_left, top_right, bottom_right, bottom_left = corners
    across = math.dist(top_left, top_right), math.dist(bottom_left, bottom_right)
    down = math.dist(top_left, bottom_left), math.dist(top_right, bottom_right)
    return sum(across) / 2, sum(down) / 2


def line_across(way: Way, corners: Corners, middle: Point, along_px: float) -> tuple[Point, Point]:
    """Return the ends of a line across a window, so far along it: degrees and pixels around its middle each."""
    part = along_px / length_px(way, corners)
    ends = ((part, 0.0), (part, 1.0)) if way == ACROSS else ((0.0, part), (1.0, part))
    one, other = (_to_polar(corners, middle, end) for end in ends)
    return one, other


def _to_polar(corners: Corners, middle: Point, at: Point) -> tuple[float, float]:
    """Return where a place of the window, (across, down) in [0, 1], lies around its middle: degrees and pixels."""
    across, down = at
    top_left, top_right, bottom_right, bottom_left = corners
    x, y = (
        (1 - down) * ((1 - across) * top_left[axis] + across * top_right[axis])
        + down * ((1 - across) * bottom_left[axis] + across * bottom_right[axis])
        - middle[axis]
        for axis in (0, 1)
    )
    return math.degrees(math.atan2(y, x)), math.hypot(x, y)


def to_window(corners: Corners, point: Point) -> tuple[float, float]:
    """Return where a place of the panel picture lies in the window, (across, down), from 0 at its top left to 1."""
    units = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    rows, sides = [], []
    for (x, y), (across, down) in zip(corners, units, strict=True):
        rows += [[x, y, 1.0, 0.0, 0.0, 0.0, -across * x, -across * y]]
        rows += [[0.0, 0.0, 0.0, x, y, 1.0, -down * x, -down * y]]
        sides += [across, down]
    matrix = np.append(np.linalg.solve(np.array(rows), np.array(sides)), 1.0).reshape(3, 3)
    across, down, scale = (matrix @ [*point, 1.0]).tolist()
    return across / scale, down / scale
