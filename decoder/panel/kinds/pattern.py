"""Rows of digits as `panel.yaml` writes them: a pattern with a sign for each digit, and what a picture shows there."""

from __future__ import annotations

import sys
from string import digits

from decoder.panel.written import DIGIT
from flight_file.untrusted import to_cell

DIGIT_OR_BLANK = "#"
CELLS = DIGIT + DIGIT_OR_BLANK
POINT = "."
MOST_SIGNS = 20


def check_pattern(pattern: str, cells: str) -> None:
    """Raise ValueError unless a pattern has digits, written with the signs in `cells`, and valid signs between them."""
    if not any(sign in cells for sign in pattern) or pattern.count(POINT) > 1:
        raise ValueError("needs a `pattern` of digits, such as 000.00, with one point at most")
    if any(sign in digits.replace(DIGIT, "") for sign in pattern):
        raise ValueError("needs `0` or `#` in its `pattern` for each digit; what it shows belongs into `shows`")
    exact = sys.float_info.dig
    if sum(sign in cells for sign in pattern) > exact:
        raise ValueError(f"has more digits in its `pattern` than the {exact} that numbers hold exactly")
    if to_cell(pattern) != pattern:
        raise ValueError(f"has a `pattern` that begins with {pattern[0]}: signs are not read, leave it out")


def check_shown(shows: str, pattern: str) -> None:
    """Raise ValueError unless the text shown agrees with the pattern, sign by sign."""
    if len(shows) != len(pattern) or not all(map(_fits, shows, pattern)):
        raise ValueError(f"`shows` is not written as {pattern}: give a sign for each of the pattern's")


def cells_before(pattern: str) -> tuple[tuple[int, int], ...]:
    """For each cell of a pattern how many cells and how many separators stand before it."""
    places = [place for place, sign in enumerate(pattern) if sign in CELLS]
    return tuple((number, place - number - places[0]) for number, place in enumerate(places))


def _fits(own: str, sign: str) -> bool:
    """Whether a sign that is shown may stand where the pattern has one."""
    if sign in CELLS:
        return own in digits or (own == " " and sign == DIGIT_OR_BLANK)
    return own == sign
