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
Side = tuple[Point, Point]

Place = Pixels | Point
"""A point of the panel picture; or its x where things move across the window, its y where they move down."""


def _of_one_kind(marks: tuple[tuple[Place, float], ...]) -> tuple[tuple[Place, float], ...]:
    if len({isinstance(place, tuple) for place, _ in marks}) > 1:
        raise ValueError("needs either points or single pixels, not both")
    return marks


PlacedMarks = Annotated[
    tuple[tuple[Place, Number], ...], Field(min_length=2, max_length=1000), AfterValidator(_of_one_kind)
]

# How precisely a corner is clicked; and by which part one end of a window usually appears larger than the other, as a
# standard deviation: one that is a quarter as long as its picture is wide, seen from ten degrees aside.
CLICK_PX = 0.5
ENDS_PART = 0.05


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


def steadied(corners: Corners) -> Corners:
    """Return a window's corners without what nobody can have seen by them: which end is nearer, if both are short.

    Half a pixel at a corner of a window seven pixels wide makes one end look a tenth wider than the other, and what is
    half way along lies a fortieth of the length further from it. So ends are as different as clicks and the usual view
    have it together.
    """
    top_left, top_right, bottom_right, bottom_left = corners
    (top_left, top_right), (bottom_left, bottom_right) = _evened((top_left, top_right), (bottom_left, bottom_right))
    (top_left, bottom_left), (top_right, bottom_right) = _evened((top_left, bottom_left), (top_right, bottom_right))
    return top_left, top_right, bottom_right, bottom_left


def _evened(one: Side, other: Side) -> tuple[Side, Side]:
    """Return two opposite sides, scaled about their middles by what clicks have probably made of their difference."""
    lengths_px = math.dist(*one), math.dist(*other)
    kept = ENDS_PART**2 / (ENDS_PART**2 + _clicked_part(*lengths_px) ** 2)
    by = (lengths_px[0] / lengths_px[1]) ** ((1.0 - kept) / 2)
    return _scaled(one, 1.0 / by), _scaled(other, by)


def _clicked_part(one_px: float, other_px: float) -> float:
    """Return by which part of its length one side may look longer than another, since four corners are clicked."""
    return math.sqrt(2.0) * CLICK_PX * math.hypot(1.0 / one_px, 1.0 / other_px)


def _scaled(side: Side, by: float) -> Side:
    (x, y), (other_x, other_y) = side
    middle_x, middle_y = (x + other_x) / 2, (y + other_y) / 2
    across, down = by * (other_x - x) / 2, by * (other_y - y) / 2
    return (middle_x - across, middle_y - down), (middle_x + across, middle_y + down)


def bow_per_px(way: Way, corners: Corners) -> float:
    """Return how far a place may lie from where it is measured along a window, pixels per square pixel.

    That is, for each pixel from one place that is known, and each from another: nothing but its ends tells how much
    smaller a window's far half appears.
    """
    top_left, top_right, bottom_right, bottom_left = corners
    down = math.dist(top_left, top_right), math.dist(bottom_left, bottom_right)
    across = math.dist(top_left, bottom_left), math.dist(top_right, bottom_right)
    clicked = _clicked_part(*(across if way == ACROSS else down))
    return clicked * ENDS_PART / math.hypot(clicked, ENDS_PART) / length_px(way, corners)


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
    for (x, y), (across, down) in zip(steadied(corners), units, strict=True):
        rows += [[x, y, 1.0, 0.0, 0.0, 0.0, -across * x, -across * y]]
        rows += [[0.0, 0.0, 0.0, x, y, 1.0, -down * x, -down * y]]
        sides += [across, down]
    matrix = np.append(np.linalg.solve(np.array(rows), np.array(sides)), 1.0).reshape(3, 3)
    across, down, scale = (matrix @ [*point, 1.0]).tolist()
    return across / scale, down / scale
