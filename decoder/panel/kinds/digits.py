"""A display of digits, as `panel.yaml` describes it."""

from __future__ import annotations

from string import digits
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from decoder.panel.description import Name, Strict, Text
from decoder.panel.kind import Control, Dial, Form, Windowed
from decoder.panel.kinds.pattern import (
    CELLS,
    DIGIT_OR_BLANK,
    MOST_SIGNS,
    POINT,
    cells_before,
    check_pattern,
    check_shown,
)
from decoder.panel.scale import Quantity
from decoder.panel.written import DIGIT, ValueType, Written


class Digits(Windowed, Strict):
    """A row of digits made of seven segments, with points or gaps between them."""

    name: Name
    """Column of the flight data."""
    pattern: Annotated[Text, Field(max_length=MOST_SIGNS)]
    """`0` for each digit, `#` where there may be none, and whatever stands between them: `000.00`, `##0`, `00:00`."""
    shows: Annotated[Text, Field(max_length=MOST_SIGNS)]
    """What the panel picture shows there, sign by sign as the pattern has them; a blank for a dark digit."""
    text: bool = False
    """Whether it is text, whose zeros in front count, as a transponder's code, and no number."""

    form: ClassVar[Form] = Form(
        "digits",
        "`digits` of a display",
        "digits of seven segments",
        "the digits",
        begun={"pattern": "000.00", "shows": ""},
        controls=(
            Control("name", "Name"),
            Control("pattern", "Pattern", "text", "000.00; # may be dark"),
            Control("shows", "Shows here", "text", "118.30; a blank where it is dark", is_of_moment=True),
            Control("text", "a code, whose zeros in front count", "check"),
        ),
        hint="Click four corners close around all digits, the dark ones too, clockwise from the top left.",
    )
    margin_part: ClassVar[float] = 0.25

    @model_validator(mode="after")
    def _pattern_has_digits(self) -> Self:
        check_pattern(self.pattern, CELLS)
        check_shown(self.shows, self.pattern)
        if not any(sign in digits for sign in self.shows):
            raise ValueError("`shows` needs digits: draw it on a picture in which the display is on")
        return self

    def check(self, _: Dial) -> None:
        """Do nothing: a window is all it needs."""

    @property
    def written(self) -> Written:
        """How its values are written."""
        return Written(ValueType.TEXT if self.text else ValueType.NUMBER, self.pattern.replace(DIGIT_OR_BLANK, DIGIT))

    @property
    def symbols(self) -> tuple[str, ...]:
        """What is in each cell of the panel picture: a digit or a blank."""
        return tuple(own for own, sign in zip(self.shows, self.pattern, strict=True) if sign in CELLS)

    @property
    def before(self) -> tuple[tuple[int, int], ...]:
        """For each cell how many cells and how many separators stand before it."""
        return cells_before(self.pattern)

    @property
    def points(self) -> tuple[int, ...]:
        """After which cells there is a decimal point."""
        cells = [sign for sign in self.pattern if sign in CELLS or sign == POINT]
        return tuple(place - 1 for place, sign in enumerate(cells) if sign == POINT and 0 < place < len(cells) - 1)

    @property
    def may_be_blank(self) -> tuple[bool, ...]:
        """For each cell whether there may be no digit."""
        return tuple(sign == DIGIT_OR_BLANK for sign in self.pattern if sign in CELLS)

    def quantities(self, dial: Dial) -> tuple[Quantity, ...]:
        """Return what it shows."""
        return (Quantity.stepped(self.name, dial.name, dial.unit, self.written),)
