"""How values are written that are not measured: states such as off and on, and a display's content, digit by digit.

Within the program each is a number: a state 0 or 1, and text the whole number that its digits make. Such values change
in steps: there is nothing between two of them, so none is interpolated and none is too fast.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum

DIGIT = "0"
STATES = ("false", "true")


class ValueType(StrEnum):
    """The type of a column of the flight data."""

    NUMBER = "number"
    BOOLEAN = "boolean"
    TEXT = "text"


@dataclass(frozen=True, slots=True)
class Written:
    """How a column's values are written.

    Attributes
    ----------
    type
        A number as a display shows it, a boolean, or text.
    pattern
        A number's or a text's, with `0` for each digit, such as `000.00` or `00:00:00`; empty for a boolean.
    """

    type: ValueType
    pattern: str = ""

    @property
    def decimals(self) -> int:
        """How many decimals a number has."""
        return len(self.pattern.partition(".")[2]) if self.type is ValueType.NUMBER else 0

    @property
    def resolution(self) -> float:
        """The step of a number's last digit; 1 for a state or a text."""
        return 10.0**-self.decimals

    @property
    def limits(self) -> tuple[float, float]:
        """The lowest and the highest value that can be written."""
        if self.type is ValueType.BOOLEAN:
            return 0.0, 1.0
        return 0.0, (10 ** self.pattern.count(DIGIT) - 1) / (10**self.decimals)

    def text_of(self, value: float) -> str:
        """Write a value; an empty text if there is none."""
        if not math.isfinite(value):
            return ""
        if self.type is ValueType.BOOLEAN:
            return STATES[round(value)]
        if self.type is ValueType.NUMBER:
            return f"{value:.{max(self.decimals, 1)}f}"
        digits = iter(f"{round(value):0{self.pattern.count(DIGIT)}d}")
        return "".join(next(digits) if sign == DIGIT else sign for sign in self.pattern)

    def value_of(self, text: str) -> float:
        """Return the value that was written; NaN for an empty text.

        Raises
        ------
        ValueError
            If it is nothing that `text_of` writes.
        """
        if not text:
            return math.nan
        if self.type is ValueType.BOOLEAN:
            state = text.strip().lower()  # other programs write True and FALSE
            if state not in STATES:
                raise ValueError(f"{text!r} is neither true nor false")
            return float(STATES.index(state))
        if self.type is ValueType.NUMBER:
            return float(text)
        wanted = "".join("[0-9]" if sign == DIGIT else re.escape(sign) for sign in self.pattern)
        if not re.fullmatch(wanted, text):
            raise ValueError(f"{text!r} is not written as {self.pattern}")
        return float("".join(sign for sign, own in zip(text, self.pattern, strict=True) if own == DIGIT))


BOOLEAN = Written(ValueType.BOOLEAN)
