"""panel.yaml: correct panels are accepted, and wrong values are named with their full path."""

from __future__ import annotations

import functools
import operator
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from decoder.panel.errors import DecoderError, PanelError
from decoder.panel.panel import parse_panel
from tests.decoder.cockpit import parse

NAN, INF = float("nan"), float("inf")


def spoil(content: dict[str, Any], path: str, value: object) -> None:
    """Sets the value at a path such as `gauges.1.sweep`; `None` removes it."""
    parts: list[Any] = [int(part) if part.isdigit() else part for part in path.split(".")]
    *parents, last = parts
    owner: Any = functools.reduce(operator.getitem, parents, content)
    if value is None:
        del owner[last]
    else:
        owner[last] = value


def test_good_panel_is_taken_as_it_stands(document: dict[str, Any]) -> None:
    """Needles are in the order of the file, marks in that of their angles; a picture is named once."""
    fuel = document["gauges"][1]
    fuel["scale"] = [[420, 0], [120, 3000], [270, 1500]]
    fuel["needles"][0]["scale"] = [[120, 0], [420, 12]]  # two needles of one dial may show different things
    for needle in fuel["needles"]:
        needle["template"] = {"picture": "needle.png"}
    panel = parse(document)

    assert [needle.name for needle in panel.needles] == ["speed_kt", "al_lb", "fr_lb"]
    assert [quantity.full_scale for quantity in panel.quantities] == [1000.0, 12.0, 3000.0]
    assert panel.gauges[1].scale == ((120.0, 3000.0), (270.0, 1500.0), (420.0, 0.0))
    assert panel.pictures == ("panel.png", "needle.png")


WRONG = [
    ("name", None, "name", "is missing"),
    ("anchors", [], "anchors", "at least 1"),
    ("focal_length_mm", 0, "focal_length_mm", "must be more than 0"),
    ("colour", "red", "colour", "is not a key of the panel format"),
    ("level", [[10, 10], [12, 11]], "level", "shorter than 16 pixels"),
    ("level", [[10, 10]], "level[1]", "is missing"),
    ("anchors.0.box", [140, 12, 7, 40], "anchors[0].box[2]", "must be 8 or more"),
    ("gauges.1.sweep", [420, 120], "gauges[1].sweep", "is empty"),
    ("gauges.1.sweep", [0, 361], "gauges[1].sweep", "more than a turn"),
    ("gauges.1.sweep", [NAN, 420], "gauges[1].sweep[0]", "finite"),
    ("gauges.1.radius", [52, 20], "gauges[1].radius", "must run outward"),
    ("gauges.1.radius", [50, 51], "gauges[1].radius", "at least 2 pixels"),
    ("gauges.1.radius", [-1, 52], "gauges[1].radius[0]", "must be more than 0"),
    ("gauges.1.centre", [1, INF], "gauges[1].centre[1]", "finite"),
    ("gauges.1.centre", "middle", "gauges[1].centre", "is not a list"),
    ("gauges.1.scale", [[120, 0]], "gauges[1].scale", "at least two"),
    ("gauges.1.scale", [[120, 0], [270, 5], [420, 3]], "gauges[1].scale", "monotone"),
    ("gauges.1.scale", [[120, 0], [120, 3]], "gauges[1].scale", "monotone"),
    ("gauges.1.scale", [[120, 0], [270, "many"]], "gauges[1].scale[1][1]", "number"),
    ("gauges.1.wraps", 3000, "gauges[1]", "needs a `sweep` of exactly 360 degrees"),
    ("gauges.1.wraps", 0, "gauges[1].wraps", "must be more than 0"),
    ("gauges.1.needles.0.wraps", 10, "gauges[1].needles[0]", "needs a `scale` beside it"),
    ("gauges.1.needles.0.scale", [[120, 0], [120, 3]], "gauges[1].needles[0].scale", "monotone"),
    ("gauges.1.needles", None, "gauges[1]", "needs either `needles` or a `card`"),
    ("gauges.1.card", {"name": "x_deg", "index": 270}, "gauges[1]", "a `card` goes all the way round"),
    ("gauges.1.stops", [80, 441], "gauges[1]", "`stops` must hold the `sweep`"),
    ("gauges.1.needles.0.name", "al lb", "gauges[1].needles[0].name", "must begin with a letter"),
    ("gauges.1.needles.0.covered_by", "nobody", "gauges[1]", "names nobody, which is no needle of this gauge"),
    ("gauges.1.needles.1.covered_by", "al_lb", "gauges[1]", "runs in a circle"),
    ("gauges.1.needles.0.template", {}, "gauges[1].needles[0].template", "give `at`"),
    ("gauges.1.needles.0.template", {"at": 200}, "gauges[1].needles[0].template", "`at` needs `span`"),
    ("gauges.1.needles.0.template.span", 1, "gauges[1].needles[0].template.span", "must be 2 or more"),
    ("gauges.1.needles.0.template.span", 91, "gauges[1].needles[0].template.span", "must be 90 or less"),
    ("gauges.0.needles.0.name", "fr_lb", "", "two columns of the flight data would be called fr_lb"),
    ("gauges.0.needles.0.name", "fr_lb_sigma", "", "two columns of the flight data would be called fr_lb_sigma"),
    ("gauges.0.needles.0.name", "time_s", "", "two columns of the flight data would be called time_s"),
]


@pytest.mark.parametrize(("where", "value", "path", "problem"), WRONG, ids=lambda part: str(part)[:40])
def test_wrong_value_is_named_with_its_path(
    document: dict[str, Any], where: str, value: object, path: str, problem: str
) -> None:
    """One sentence says which file, which value and what is wrong with it."""
    spoil(document, where, value)
    refused(document, path, problem)


def refused(document: dict[str, Any], path: str, problem: str) -> None:
    """The path, in its own file, of a panel's first wrong value."""
    with pytest.raises(PanelError) as caught:
        parse_panel(yaml.safe_dump(document), source="panel.yaml in flight.mcap")

    assert caught.value.path == path
    assert problem in caught.value.problem
    assert str(caught.value).startswith(
        f"panel.yaml in flight.mcap: {path}: " if path else "panel.yaml in flight.mcap: "
    )
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("scale", [[0, 0], [360, 300]], "does not fit `wraps: 360`"),
        ("scale", [[0, 0], [180, 360]], "does not fit `wraps: 360`"),
        ("scale", [[90, 180], [270, 0]], "leave open which way values rise"),
        ("stops", [0, 360], "has no `stops`"),
    ],
)
def test_turn_that_does_not_close_is_refused(
    document: dict[str, Any], key: str, value: list[object], problem: str
) -> None:
    """A scale all the way round spans exactly one turn and one turn's value, and has no stops."""
    document["gauges"][0] |= {"sweep": [0, 360], "wraps": 360, "scale": [[0, 0], [90, 90]], key: value}
    refused(document, "gauges[0]", problem)


COMBINED_WRONG = [
    ({"combined": {"needles": ["al_lb"]}}, "gauges[1].combined.needles", "at least 2"),
    ({"combined": {"needles": ["al_lb", "nobody"]}}, "gauges[1]", "names a needle that this gauge does not have"),
    (
        {"combined": {"needles": ["al_lb", "al_lb"]}},
        "gauges[1]",
        "a needle that this gauge does not have, or one twice",
    ),
    ({"combined": {"tolerance": 0.5}}, "gauges[1].combined.tolerance", "less than 0.5"),
    ({"combined": {"name": "speed_kt"}}, "", "two columns of the flight data would be called speed_kt"),
    *(
        ({"needle": {"wraps": wraps, "scale": [[0, 0], [90, turn / 4]]}}, "gauges[1]", "`combined`")
        for wraps, turn in ((None, 80), (150, 150), (100, 100), (90, 90))
    ),
]


@pytest.mark.parametrize(("change", "path", "problem"), COMBINED_WRONG, ids=lambda part: str(part)[:40])
def test_pointers_that_do_not_combine_are_refused(
    document: dict[str, Any], change: dict[str, Any], path: str, problem: str
) -> None:
    """Pointers of one value are on one gauge, go all the way round, and count whole turns of the next."""
    gauge = document["gauges"][1]
    gauge |= {"sweep": [0, 360], "wraps": 100, "scale": [[0, 0], [90, 25]]}
    gauge["needles"][0] |= {"wraps": 1000, "scale": [[0, 0], [90, 250]]}
    gauge["combined"] = {"name": "fuel_lb", "needles": ["al_lb", "fr_lb"]}
    assert parse(document).combinations[0].parts == ("fr_lb", "al_lb")
    gauge["combined"] |= change.get("combined", {})
    gauge["needles"][0] |= change.get("needle", {})
    refused(document, path, problem)


def test_number_of_further_mistakes_is_told(document: dict[str, Any]) -> None:
    """The first wrong value is named, the others are counted."""
    document["gauges"][0]["sweep"] = [1, 1]
    document["gauges"][1]["sweep"] = [1, 1]

    with pytest.raises(PanelError, match=r"gauges\[0\]\.sweep: .* \(and 1 more\)"):
        parse(document)


@given(text=st.text(max_size=200) | st.binary(max_size=200))
def test_any_text_is_refused_as_a_panel_error(text: str | bytes) -> None:
    """No text makes the parser raise anything but PanelError."""
    with pytest.raises(DecoderError):
        parse_panel(text)
