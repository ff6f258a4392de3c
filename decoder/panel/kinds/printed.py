"""Printed digits, as `panel.yaml` describes them: on drums that roll and carry, on wheels that step, or in any font."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from decoder.panel.arrays import NO_TRUTH, Floats
from decoder.panel.description import Name, PictureName, Positive, Strict, Text
from decoder.panel.kind import Control, Dial, Form, Windowed
from decoder.panel.kinds.pattern import DIGIT_OR_BLANK, MOST_SIGNS, cells_before, check_pattern, check_shown
from decoder.panel.kinds.straight import Corners, size_px
from decoder.panel.scale import Quantity
from decoder.panel.thresholds import LEAST_WINDOW_PX
from decoder.panel.written import DIGIT, ValueType, Written

DIGITS = 10

Signs = Annotated[Text, Field(max_length=MOST_SIGNS)]


class Taught(Strict):
    """Another picture that shows the same digits, to teach those that the panel picture does not show."""

    picture: PictureName
    """Of the same panel: a frame of the flight, or any other photograph."""
    shows: Signs
    """What it shows, as the gauge's own `shows`."""
    window: Corners | None = None
    """The window's corners in it, where they are not where the panel picture has them."""


class Printed(Windowed, Strict):
    """A row of printed digits: an altimeter's setting, a counter, a transponder's code."""

    name: Name
    """Column of the flight data."""
    pattern: Signs
    """`0` for each digit, and whatever stands between them: `00.00`, `00000`, `00:00`."""
    shows: Signs
    """What the panel picture shows there; of drums that roll a digit more may tell how far the last one has rolled."""
    also: Annotated[tuple[Taught, ...], Field(max_length=20)] = ()
    """Other pictures, that show other digits."""
    rolls: Literal["up", "down"] | None = None
    """Which way its drums roll as the value rises; nothing where digits step."""
    pitch: Positive | None = None
    """Of drums that roll, how many pixels it is from one digit to the next; as many as the window is high, if empty."""
    times: Positive = 1.0
    """What a 1 in the last place is worth beyond what the pattern says, as 100 where hundreds of feet are last."""
    gap: Annotated[float, Field(ge=0.0, le=2.0), NO_TRUTH] = 0.0
    """How wide each sign that stands between digits is, of a digit's width."""
    text: bool = False
    """Whether it is text, whose zeros in front count, as a transponder's code, and no number."""
    max_rate: Positive | None = None
    """How fast the value on drums that roll can change, in its unit a second."""

    form: ClassVar[Form] = Form(
        "printed",
        "`printed` digits",
        "printed digits or drums",
        "the digits",
        begun={"pattern": "00.00", "shows": ""},
        controls=(
            Control("name", "Name"),
            Control("pattern", "Pattern", "text", "00.00"),
            Control("shows", "Shows here", "text", "29.92; 29.925 where the last drum is half way", is_of_moment=True),
            Control("rolls", "Rolls as it rises", "optional_text", "up or down; empty where digits step"),
            Control("pitch", "Digit to digit", "optional", "pixels along a drum; empty: the window's height"),
            Control("gap", "Sign between", "optional", "its width, of a digit's, as 0.4; empty for none"),
            Control("text", "a code, whose zeros in front count", "check"),
            Control("max_rate", "Fastest change", "optional", "a second, if known"),
        ),
        hint="Click four corners close around all digits, clockwise from the top left; of drums around what is seen of"
        " them. Only digits that a picture shows are read: `also` in panel.yaml names more pictures.",
    )

    @model_validator(mode="after")
    def _digits_are_told(self) -> Self:
        check_pattern(self.pattern, DIGIT)
        if DIGIT_OR_BLANK in self.pattern:
            raise ValueError(f"has `{DIGIT_OR_BLANK}` in its `pattern`: no printed digit is blank, write `{DIGIT}`")
        for shows in self._shown:
            check_shown(self._whole(shows), self.pattern)
        told = self.model_fields_set & {"pitch", "max_rate", "times"}
        if self.rolls is None and told:
            raise ValueError(f"`{min(told)}` is of drums that roll: say which way, `rolls: up` or `down`")
        if self.rolls is not None and self.text:
            raise ValueError("`text` steps from one value to the next: a code's digits do not roll")
        return self

    @property
    def _shown(self) -> tuple[str, ...]:
        return (self.shows, *(taught.shows for taught in self.also))

    def _whole(self, shows: str) -> str:
        """Return what is shown without the sign that tells how far the last drum has rolled."""
        is_between = self.rolls is not None and len(shows) == len(self.pattern) + 1 and shows[-1] in "0123456789"
        return shows[:-1] if is_between else shows

    def check(self, dial: Dial) -> None:
        """ValueError where its drums do not go with its window."""
        cells = len(self.before) + self.gap * self.before[-1][1]
        if dial.window is not None and size_px(dial.window)[0] < 2 * cells:
            raise ValueError("has digits narrower than two pixels in its `window`: they show nothing to read")
        if self.pitch is not None and dial.window is not None and self.pitch > 3 * size_px(dial.window)[1]:
            raise ValueError("has a `pitch` of more than three times its `window`'s height, which shows no digit then")
        if self.pitch is not None and self.pitch < LEAST_WINDOW_PX:
            raise ValueError(f"needs a `pitch` of {LEAST_WINDOW_PX:g} pixels or more: fewer show no digit")

    @property
    def written(self) -> Written:
        """How its values are written."""
        return Written(ValueType.TEXT if self.text else ValueType.NUMBER, self.pattern)

    @property
    def before(self) -> tuple[tuple[int, int], ...]:
        """For each cell how many cells and how many separators stand before it."""
        return cells_before(self.pattern)

    @property
    def step(self) -> float:
        """What a 1 in the last place is worth."""
        return self.written.resolution * self.times

    def shown_counts(self) -> tuple[float, ...]:
        """Return what each picture shows, the panel picture first, counted in the last place."""
        counts = []
        for shows in self._shown:
            whole = self._whole(shows)
            digits = "".join(own for own, sign in zip(whole, self.pattern, strict=True) if sign == DIGIT)
            counts.append(int(digits) + int(shows[len(whole) :] or "0") / DIGITS)
        return tuple(counts)

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return what it shows."""
        if self.rolls is None:
            return (Quantity.stepped(self.name, dial.name, dial.unit, self.written),)
        count = DIGITS ** len(self.before)
        marks, limits = ((0.0, 0.0), (1.0, self.step)), (0.0, count * self.step)
        own = Quantity(self.name, dial.name, dial.unit, marks, None, None, self.max_rate, limits=limits)
        return (replace(own, is_drawn=False),)

    def pictures(self) -> Mapping[str, str]:
        """Return those that teach digits."""
        return {f"printed.also[{place}].picture": taught.picture for place, taught in enumerate(self.also)}


def drums_at(counts: Floats, drums: int) -> Floats:
    """(..., D): where each drum stands, in digits, the last one last: each moves while the next turns from 9 to 0."""
    places = np.empty((*counts.shape, drums))
    moved = counts % 1.0
    whole = np.floor(counts)
    for drum in range(drums - 1, -1, -1):
        digit = whole % DIGITS
        places[..., drum] = digit + moved
        moved = np.where(digit == DIGITS - 1, moved, 0.0)
        whole = whole // DIGITS
    return places
