"""What moves along when a panel is carried over to another picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from decoder.setup.pasting import carry_typed
from tests.windows import WINDOW


def moved(at: Sequence[float]) -> list[float]:
    """A place in a picture that shows all 5 pixels further right and 7 further down."""
    return [at[0] + 5, at[1] + 7]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({"linear": {"marks": [[62, 0], [80, 10]], "at": 64}}, {"linear": {"marks": [[69, 0], [87, 10]]}}),
        ({"linear": {"moves": "across", "marks": [[90, 0]]}}, {"linear": {"moves": "across", "marks": [[95, 0]]}}),
        ({"tape": {"index": [120, 70], "marks": [[90, 1]]}}, {"tape": {"index": [125, 77]}}),
        ({"digits": {"pattern": "00", "shows": "12"}}, {"digits": {"pattern": "00"}}),
        ({"ball": {"tube": [[80, 90, -1], [120, 96, 0]]}}, {"ball": {"tube": [[85, 97, -1], [125, 103, 0]]}}),
    ],
)
def test_places_move_along_and_what_was_shown_is_asked_anew(before: dict[str, Any], after: dict[str, Any]) -> None:
    """Marks, an index and a tube lie where the other picture has them; what an instrument showed is not carried."""
    gauge = {"window": WINDOW, **before}
    carry_typed(gauge, moved)

    assert gauge == {"window": WINDOW, **after}
