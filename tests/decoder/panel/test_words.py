"""Errors in a panel are reported in our words, for people who do not know the validation library."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from decoder.panel.description import SAID, UNKNOWN, problems_in
from decoder.panel.panel import Panel
from tests.hostile import places
from tests.programs import FIXTURES, yaml_of
from tests.windows import IN_WINDOWS, WINDOW

DAMAGE: tuple[Any, ...] = (None, "two words", [], -1, 1e9, float("nan"), {"a": 1})


def whole() -> dict[str, Any]:
    """A panel with an instrument of every kind."""
    panel: dict[str, Any] = yaml_of(FIXTURES / "oblique" / "odd_small" / "panel.yaml")
    horizon = yaml_of(FIXTURES / "borrowed" / "attitude_daylight" / "panel.yaml")
    kept = {"heading_card", "altimeter"}
    gauges = [gauge for gauge in panel["gauges"] if gauge["name"] in kept] + horizon["gauges"][:1]
    ball = {
        "name": "slip",
        "ball": {"name": "slip_balls", "tube": [[80, 90, -1], [120, 96, 0], [160, 90, 1]], "width": 9},
    }
    windows = [{"name": key, "window": WINDOW, key: own} for key, own in IN_WINDOWS.items()]
    short = {"anchors": panel["anchors"][:1], "reference_points": panel["reference_points"][:1]}
    columns = {"columns": {"squawk": {"above": 7000, "means": "none"}}}
    return panel | short | columns | {"gauges": [*gauges, ball, *windows]}


def damaged() -> Iterator[dict[str, Any]]:
    """The panel with each of its parts removed, then replaced by something wrong."""
    good = whole()
    for path in places(good):
        for bad in (..., *DAMAGE):
            panel = copy.deepcopy(good)
            owner: Any = panel
            for key in path[:-1]:
                owner = owner[key]
            if bad is ...:
                del owner[path[-1]]
            else:
                owner[path[-1]] = bad
            yield panel


@pytest.mark.slow
def test_no_phrase_of_the_library_is_said_whatever_is_wrong() -> None:
    """Each value of a panel of every kind is damaged in turn: the error is reported in our own words."""
    assert problems_in(Panel, whole(), thing="panel") == []
    kinds, said, theirs = set(), set(), set()
    for panel in damaged():
        said |= {problem for _, problem in problems_in(Panel, panel, thing="panel")}
        try:
            Panel.model_validate(panel)
        except ValidationError as found:
            errors = [each for each in found.errors() if each["type"] != "value_error"]
            kinds |= {each["type"] for each in errors}
            theirs |= {each["msg"].lower() for each in errors}

    assert kinds - {"extra_forbidden"} <= SAID.keys()
    assert UNKNOWN not in said
    assert len(theirs) > 15
    assert not [problem for problem in said if any(phrase in problem.lower() for phrase in theirs)]
    assert not [problem for problem in said if "{" in problem.replace("{name:", "")]
