"""A scale that slides or turns behind a fixed index in a window, as `panel.yaml` describes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import ClassVar

from decoder.panel.description import Name, Positive, Strict
from decoder.panel.kind import Control, Dial, Form, Polar, Windowed
from decoder.panel.kinds.straight import (
    WAYS,
    Corners,
    Place,
    PlacedMarks,
    Way,
    corners_of,
    length_px,
    line_across,
    places_px,
)
from decoder.panel.scale import FULL_CIRCLE_DEG, Quantity


class Tape(Windowed, Strict):
    """A tape or a drum behind a fixed index: a compass card seen from its rim, an altitude tape."""

    name: Name
    """Column of the flight data."""
    moves: Way = "down"
    """Along which sides of its window it moves, `down` or `across`."""
    index: Place
    """Where it is read: a point of the panel picture, or only its y, or its x where it moves across."""
    marks: PlacedMarks
    """[place, value] of two marks or more, as far apart as the panel picture shows them; of a drum four or more."""
    turn: Positive | None = None
    """What a whole turn is worth, where values begin again after it."""
    drum: bool = False
    """Whether it is the rim of a drum or card, whose marks crowd together towards the ends of its window."""
    max_rate: Positive | None = None
    """How fast its value can change, in its unit a second."""

    form: ClassVar[Form] = Form(
        "tape",
        "a `tape` behind an index",
        "a tape or drum under an index",
        "a tape that moves",
        begun={"moves": "down"},
        controls=(
            Control("name", "Name"),
            Control("moves", "It moves", options=WAYS),
            Control("index", "Read at", "place", "pixels down (or across) the picture"),
            Control(
                "marks", "Marks", "places", "pixels down (or across) the picture, value: 400 10", is_of_moment=True
            ),
            Control("turn", "A turn is worth", "optional", "360 for a compass; empty if it never begins again"),
            Control("drum", "the rim of a drum or card", "check"),
            Control("max_rate", "Fastest change", "optional", "a second, if known"),
        ),
        hint="Click the four corners of what is seen of it, clockwise from its top left, without its frame.",
    )

    def drawn(self, corners: Corners) -> tuple[tuple[float, float, float], ...]:
        """Return its marks: pixels along and across its window, and the value, unrolled where they pass a turn."""
        told: list[tuple[float, float, float]] = []
        for place, value in self.marks:
            unrolled = value
            if told and self.turn is not None:
                unrolled -= self.turn * round((value - told[-1][2]) / self.turn)
            told.append((*places_px(self.moves, corners, place), unrolled))
        return tuple(sorted(told))

    def index_px(self, corners: Corners) -> float:
        """Return where it is read, pixels along its window."""
        return places_px(self.moves, corners, self.index)[0]

    def check(self, dial: Dial) -> None:
        """ValueError where its marks do not go with its window."""
        corners = corners_of(dial.window)
        marks = self.drawn(corners)
        steps = {
            (after[0] > before[0]) * math.copysign(1.0, after[2] - before[2]) * (after[2] != before[2])
            for before, after in pairwise(marks)
        }
        if steps not in ({1.0}, {-1.0}):
            raise ValueError("needs `marks` at different places, values only rising or only falling along the window")
        if self.drum and (self.turn is None or len(marks) < 4):  # noqa: PLR2004 - of three unknowns
            raise ValueError("that is a `drum` needs its `turn`, and four `marks` or more")
        shown = abs(marks[-1][2] - marks[0][2]) / (marks[-1][0] - marks[0][0]) * length_px(self.moves, corners)
        if self.turn is not None and self.turn > 50 * shown:  # a compass card shows more than 7 degrees
            raise ValueError(
                "has a `turn` more than 50 times as long as its window: check it and the `marks`, or"
                " leave it out where values never begin again"
            )
        if not 0.0 <= self.index_px(corners) <= length_px(self.moves, corners):
            raise ValueError("needs its `index` within its `window`")

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return what stands at the index: by the angle where it turns, else by itself."""
        if self.turn is not None:
            marks = ((0.0, 0.0), (FULL_CIRCLE_DEG, self.turn))
            return (Quantity(self.name, dial.name, dial.unit, marks, self.turn, None, self.max_rate),)
        values = sorted(value for _, value in self.marks)
        ends = (values[0], values[0]), (values[-1], values[-1])
        return (Quantity(self.name, dial.name, dial.unit, ends, None, None, self.max_rate, goes_on=True),)

    def lines(self, dial: Dial, values: Mapping[str, float]) -> Mapping[str, tuple[Polar, Polar]]:
        """Return the index across its window, where there is a value."""
        if not math.isfinite(values[self.name]):
            return {}
        corners = corners_of(dial.window)
        return {self.name: line_across(self.moves, corners, dial.centre, self.index_px(corners))}
