"""A pointer that slides along a straight scale, as `panel.yaml` describes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from decoder.panel.description import Name, Positive, Strict
from decoder.panel.kind import Control, Dial, Form, Polar, Windowed
from decoder.panel.kinds.straight import (
    WAYS,
    Corners,
    Place,
    PlacedMarks,
    Way,
    bow_per_px,
    corners_of,
    length_px,
    line_across,
    places_px,
)
from decoder.panel.scale import Marks, Quantity, Scale, monotone
from decoder.panel.thresholds import LEAST_WINDOW_PX


class Linear(Windowed, Strict):
    """A pointer that slides along a straight scale in a window: a flap indicator, an edgewise instrument."""

    name: Name
    """Column of the flight data."""
    moves: Way = "down"
    """Along which sides of its window it slides, `down` or `across`."""
    marks: PlacedMarks
    """[place, value] of two or more: a point of the panel picture, or only its y, or its x where it slides across."""
    at: Place
    """Where the pointer is in the panel picture."""
    span: Positive
    """How many pixels of the window are cut along the scale, two or three times the width of the pointer."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""

    form: ClassVar[Form] = Form(
        "linear",
        "a `linear` scale",
        "a sliding pointer",
        "a pointer that slides",
        begun={"moves": "down", "span": 20.0},
        controls=(
            Control("name", "Name"),
            Control("moves", "It slides", options=WAYS),
            Control("marks", "Marks", "places", "pixels down (or across) the picture, value: 400 0, 480 10"),
            Control("at", "Pointer here at", "place", "pixels down (or across) the picture", is_of_moment=True),
            Control("span", "Pixels cut", "number", "two or three times the pointer's width"),
            Control("max_rate", "Fastest change", "optional", "a second, if known"),
        ),
        hint="Click the four corners around the way of the pointer, clockwise from its top left, no wider than that.",
    )
    margin_part: ClassVar[float] = 0.5

    def along(self, corners: Corners) -> Marks:
        """Return its marks as pixels along its window."""
        return monotone(tuple((places_px(self.moves, corners, place)[0], value) for place, value in self.marks))

    def at_px(self, corners: Corners) -> float:
        """Return where it is in the panel picture, pixels along its window."""
        return places_px(self.moves, corners, self.at)[0]

    def check(self, dial: Dial) -> None:
        """ValueError where its marks or its pointer do not go with its window."""
        corners = corners_of(dial.window)
        try:
            self.along(corners)
        except ValueError as error:
            raise ValueError(f"`marks` of a `linear` scale: {error}") from error
        long_px = length_px(self.moves, corners)
        if not 0.0 <= self.at_px(corners) <= long_px or self.span > long_px:
            raise ValueError("needs its pointer, `at` and `span`, within its `window`")
        if self.span < LEAST_WINDOW_PX:
            raise ValueError(f"needs a `span` of {LEAST_WINDOW_PX:g} pixels or more: fewer show no pointer")

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return its value, by pixels along its window."""
        corners = corners_of(dial.window)
        marks, bow = self.along(corners), bow_per_px(self.moves, corners)
        known = Quantity(self.name, dial.name, dial.unit, marks, None, None, self.max_rate, has_drawn_zero=True)
        return (replace(known, bow_per_deg=bow),)

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar]]:
        """Return the line across its window at which it shows its value."""
        if not np.isfinite(values[self.name]):
            return {}
        corners = corners_of(dial.window)
        along_px = float(Scale.of(self.along(corners)).angles_of(np.array([values[self.name]]))[0])
        return {self.name: line_across(self.moves, corners, dial.centre, along_px)}
