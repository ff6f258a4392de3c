"""panel.yaml: what is right is taken, and what is wrong is named with its full path."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from decoder.errors import DecoderError, PanelError
from decoder.panel import Panel, parse_panel

Parse = Callable[[Any], Panel]
NAN, INF = float("nan"), float("inf")


def spoil(content: dict[str, Any], path: str, value: object) -> None:
    """Sets what lies at a path such as `gauges.1.sweep`; `None` takes it away."""
    *parents, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    owner: Any = functools.reduce(lambda node, part: node[part], parents, content)
    if value is None:
        del owner[last]
    else:
        owner[last] = value


def test_drawn_cockpit_is_valid(parse: Parse, document: dict[str, Any]) -> None:
    """A good panel is taken as it stands, needles in the order of the file."""
    panel = parse(document)

    assert [needle.name for needle in panel.needles] == ["speed_kt", "al_lb", "fr_lb"]
    assert [quantity.full_scale for quantity in panel.quantities] == [1000.0, 3000.0, 3000.0]
    assert panel.pictures == ("panel.png",)


WRONG = [
    ("name", None, "name", "is missing"),
    ("picture", None, "picture", "is missing"),
    ("anchors", None, "anchors", "is missing"),
    ("gauges", None, "gauges", "is missing"),
    ("anchors", [], "anchors", "at least 1"),
    ("gauges", [], "gauges", "at least 1"),
    ("focal_length_mm", 0, "focal_length_mm", "greater than 0"),
    ("colour", "red", "colour", "is not a key of the panel format"),
    ("level", [[10, 10], [12, 11]], "level", "shorter than 16 pixels"),
    ("level", [[10, 10]], "level[1]", "is missing"),
    ("anchors.0.box", [140, 12, 7, 40], "anchors[0].box[2]", "greater than or equal to 8"),
    ("anchors.0.radius", 3, "anchors[0].radius", "is not a key of the panel format"),
    ("gauges.1.sweep", [420, 120], "gauges[1].sweep", "is empty"),
    ("gauges.1.sweep", [120, 120], "gauges[1].sweep", "is empty"),
    ("gauges.1.sweep", [0, 361], "gauges[1].sweep", "more than a turn"),
    ("gauges.1.sweep", [NAN, 420], "gauges[1].sweep[0]", "finite"),
    ("gauges.1.sweeps", [120, 420], "gauges[1].sweeps", "is not a key of the panel format"),
    ("gauges.1.radius", [52, 20], "gauges[1].radius", "must run outward"),
    ("gauges.1.radius", [50, 51], "gauges[1].radius", "at least 2 pixels"),
    ("gauges.1.radius", [-1, 52], "gauges[1].radius[0]", "greater than 0"),
    ("gauges.1.centre", [1, INF], "gauges[1].centre[1]", "finite"),
    ("gauges.1.centre", "middle", "gauges[1].centre", "tuple"),
    ("gauges.1.scale", [[120, 0]], "gauges[1].scale", "at least two"),
    ("gauges.1.scale", [[120, 0], [270, 5], [420, 3]], "gauges[1].scale", "monotone"),
    ("gauges.1.scale", [[120, 0], [270, 0], [420, 3]], "gauges[1].scale", "monotone"),
    ("gauges.1.scale", [[120, 0], [120, 3]], "gauges[1].scale", "monotone"),
    ("gauges.1.scale", [[120, 0], [270, "many"]], "gauges[1].scale[1][1]", "number"),
    ("gauges.1.wraps", 3000, "gauges[1]", "needs a `sweep` of exactly 360 degrees"),
    ("gauges.1.wraps", 0, "gauges[1].wraps", "greater than 0"),
    ("gauges.1.needles.0.wraps", 10, "gauges[1].needles[0]", "needs a `scale` beside it"),
    ("gauges.1.needles.0.scale", [[120, 0], [120, 3]], "gauges[1].needles[0].scale", "monotone"),
    ("gauges.1.needles", None, "gauges[1]", "needs either `needles` or a `card`"),
    ("gauges.1.card", {"name": "x_deg", "index": 270}, "gauges[1]", "needs either `needles` or a `card`"),
    ("gauges.1.stops", [130, 430], "gauges[1]", "`stops` must hold the `sweep`"),
    ("gauges.1.stops", [80, 441], "gauges[1]", "`stops` must hold the `sweep`"),
    ("gauges.1.needles", [], "gauges[1].needles", "at least 1"),
    ("gauges.1.needles.0.name", "al lb", "gauges[1].needles[0].name", "pattern"),
    ("gauges.1.needles.0.name", "7up", "gauges[1].needles[0].name", "pattern"),
    ("gauges.1.needles.0.covered_by", "nobody", "gauges[1]", "names nobody, which is no needle of this gauge"),
    ("gauges.1.needles.0.covered_by", "speed_kt", "gauges[1]", "names speed_kt, which is no needle of this gauge"),
    ("gauges.1.needles.0.covered_by", "al_lb", "gauges[1]", "runs in a circle"),
    ("gauges.1.needles.1.covered_by", "al_lb", "gauges[1]", "runs in a circle"),
    ("gauges.1.needles.0.template", {}, "gauges[1].needles[0].template", "give `at`"),
    ("gauges.1.needles.0.template", {"at": 200}, "gauges[1].needles[0].template", "`at` needs `span`"),
    ("gauges.1.needles.0.template.span", 1, "gauges[1].needles[0].template.span", "greater than or equal to 2"),
    ("gauges.1.needles.0.template.span", 91, "gauges[1].needles[0].template.span", "less than or equal to 90"),
    ("gauges.1.needles.0.template.from", 1, "gauges[1].needles[0].template.from", "is not a key of the panel format"),
    ("gauges.1.needles.0.name", "fr_lb", "", "two columns of the flight data would be called fr_lb"),
    ("gauges.0.needles.0.name", "fr_lb", "", "two columns of the flight data would be called fr_lb"),
    ("gauges.0.needles.0.name", "fr_lb_sigma", "", "two columns of the flight data would be called fr_lb_sigma"),
    ("gauges.0.needles.0.name", "time_s", "", "two columns of the flight data would be called time_s"),
]


@pytest.mark.parametrize(("where", "value", "path", "problem"), WRONG, ids=lambda part: str(part)[:40])
def test_wrong_value_is_named_with_its_path(
    parse: Parse, document: dict[str, Any], where: str, value: object, path: str, problem: str
) -> None:
    """One sentence says which file, which value and what is wrong with it."""
    spoil(document, where, value)
    with pytest.raises(PanelError) as refused:
        parse(document)

    assert refused.value.path == path
    assert problem in refused.value.problem
    assert str(refused.value).startswith(f"panel.yaml: {path}: " if path else "panel.yaml: ")
    assert "\n" not in str(refused.value)


ROUND_WRONG = [
    ("scale", [[0, 0], [360, 300]], "gauges[0]", "does not fit `wraps: 360`"),
    ("scale", [[0, 0], [180, 360]], "gauges[0]", "does not fit `wraps: 360`"),
    ("stops", [0, 360], "gauges[0]", "has no `stops`"),
]


@pytest.mark.parametrize(("key", "value", "path", "problem"), ROUND_WRONG, ids=lambda part: str(part)[:40])
def test_turn_that_does_not_close_is_refused(
    parse: Parse, document: dict[str, Any], key: str, value: object, path: str, problem: str
) -> None:
    """A scale all the way round is one turn and one turn's value, and has no stops."""
    document["gauges"][0] |= {"sweep": [0, 360], "wraps": 360, "scale": [[0, 0], [90, 90]], key: value}
    with pytest.raises(PanelError) as refused:
        parse(document)

    assert refused.value.path == path
    assert problem in refused.value.problem


COMBINED_WRONG = [
    ({"needles": ["al_lb"]}, "gauges[1].combined.needles", "at least 2"),
    ({"needles": ["al_lb", "nobody"]}, "gauges[1]", "names a needle that this gauge does not have"),
    ({"needles": ["al_lb", "al_lb"]}, "gauges[1]", "names a needle that this gauge does not have, or one twice"),
    ({"tolerance": 0.5}, "gauges[1].combined.tolerance", "less than 0.5"),
    ({"name": "speed_kt"}, "", "two columns of the flight data would be called speed_kt"),
]


@pytest.mark.parametrize(("change", "path", "problem"), COMBINED_WRONG, ids=lambda part: str(part)[:40])
def test_pointers_that_do_not_combine_are_refused(
    parse: Parse, document: dict[str, Any], change: dict[str, object], path: str, problem: str
) -> None:
    """Pointers of one value are of one gauge, and each counts the turns of the next."""
    gauge = document["gauges"][1]
    gauge |= {"sweep": [0, 360], "wraps": 100, "scale": [[0, 0], [90, 25]]}
    gauge["needles"][0] |= {"wraps": 1000, "scale": [[0, 0], [90, 250]]}
    gauge["combined"] = {"name": "fuel_lb", "needles": ["al_lb", "fr_lb"]}
    assert parse(document).combinations[0].parts == ("fr_lb", "al_lb")
    gauge["combined"] |= change
    with pytest.raises(PanelError) as refused:
        parse(document)

    assert refused.value.path == path
    assert problem in refused.value.problem


@pytest.mark.parametrize("wraps", [None, 150, 100, 90])
def test_turns_that_do_not_count_are_refused(parse: Parse, document: dict[str, Any], wraps: float | None) -> None:
    """A turn of the coarse pointer is a whole number of the finer one's, and both go all the way round."""
    gauge = document["gauges"][1]
    gauge |= {"sweep": [0, 360], "wraps": 100, "scale": [[0, 0], [90, 25]]}
    gauge["combined"] = {"name": "fuel_lb", "needles": ["al_lb", "fr_lb"]}
    gauge["needles"][0] |= {"wraps": wraps, "scale": [[0, 0], [90, 20]]}
    with pytest.raises(PanelError, match="`combined`"):
        parse(document)


def test_needles_scale_stands_in_for_the_gauges(parse: Parse, document: dict[str, Any]) -> None:
    """Two needles of one dial may show different things."""
    document["gauges"][1]["needles"][0]["scale"] = [[120, 0], [420, 12]]
    panel = parse(document)

    assert [quantity.full_scale for quantity in panel.quantities] == [1000.0, 12.0, 3000.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "panel.yaml: holds no panel"),
        ("- one\n- two\n", "panel.yaml: holds no panel"),
        ("just words", "panel.yaml: holds no panel"),
        ("name: [unfinished\n", "panel.yaml: line 2: is not YAML"),
        ("name: \tx: y: z\n", "panel.yaml: line 1: is not YAML"),
        (b"\xff\xfe\x00\xd8", "is not YAML"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "is not YAML"),
    ],
    ids=["empty", "list", "text", "cut short", "not YAML", "not text", "a picture"],
)
def test_file_that_is_no_panel_is_refused(text: str | bytes, message: str) -> None:
    """Whatever else somebody gives as a panel is refused in a sentence."""
    with pytest.raises(PanelError) as refused:
        parse_panel(text)

    assert message in str(refused.value)


def test_number_of_further_mistakes_is_told(parse: Parse, document: dict[str, Any]) -> None:
    """The first wrong value is named, the others are counted."""
    document["gauges"][0]["sweep"] = [1, 1]
    document["gauges"][1]["sweep"] = [1, 1]

    with pytest.raises(PanelError, match=r"gauges\[0\]\.sweep: .* \(and 1 more\)"):
        parse(document)


def test_source_stands_first_in_the_message() -> None:
    """The message starts with the file that it speaks of."""
    with pytest.raises(PanelError, match=r"^panel\.yaml in flight\.mcap: holds no panel"):
        parse_panel("[]", source="panel.yaml in flight.mcap")


def test_marks_may_stand_in_any_order(parse: Parse, document: dict[str, Any]) -> None:
    """A scale written anticlockwise is the same scale."""
    document["gauges"][1]["scale"] = [[420, 0], [120, 3000], [270, 1500]]

    assert parse(document).gauges[1].scale == ((120.0, 3000.0), (270.0, 1500.0), (420.0, 0.0))


def test_panel_cannot_be_changed(parse: Parse, document: dict[str, Any]) -> None:
    """A panel that was checked stays as it was checked."""
    panel = parse(document)

    with pytest.raises(ValueError, match="frozen"):
        panel.name = "another"


def test_pictures_are_named_once_each(parse: Parse, document: dict[str, Any]) -> None:
    """The panel picture comes first, a picture that two needles share only once."""
    for needle in document["gauges"][1]["needles"]:
        needle["template"] = {"picture": "needle.png"}

    assert parse(document).pictures == ("panel.png", "needle.png")


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
ANYTHING = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
KEYS = [path for path, *_ in WRONG if not path.endswith(("colour", "sweeps", "from", "anchors.0.radius"))]


@given(where=st.sampled_from(KEYS), value=ANYTHING)
def test_any_value_gives_a_panel_or_a_panel_error(where: str, value: object) -> None:
    """Nothing that stands at any place of a panel raises anything but PanelError."""
    document = yaml.safe_load(GOOD)
    spoil(document, where, value if value is not None else "")

    with contextlib.suppress(PanelError):
        assert isinstance(parse_panel(yaml.safe_dump(document)), Panel)


@given(text=st.text(max_size=200) | st.binary(max_size=200))
def test_any_text_is_refused_as_a_panel_error(text: str | bytes) -> None:
    """No text at all makes the parser raise anything but PanelError."""
    with pytest.raises(DecoderError):
        parse_panel(text)


NUMBERS = st.floats(-1e4, 1e4).map(lambda number: round(number, 3))


@st.composite
def panels(draw: st.DrawFn) -> dict[str, Any]:
    """Any valid panel."""
    names = draw(st.lists(st.from_regex(r"\A[a-z]{1,6}_[0-9]{1,3}\Z"), min_size=1, max_size=4, unique=True))
    start = draw(st.integers(-180, 300))
    marks = sorted(draw(st.sets(st.integers(0, 300), min_size=2, max_size=8)))
    sign = draw(st.sampled_from([1, -1]))
    gauges = [
        {
            "name": name,
            "centre": [draw(NUMBERS), draw(NUMBERS)],
            "radius": [20, 20 + draw(st.integers(2, 90))],
            "sweep": [start, start + draw(st.integers(1, 360))],
            "scale": [[start + mark, sign * index] for index, mark in enumerate(marks)],
            "needles": [{"name": name, "template": {"at": draw(NUMBERS), "span": draw(st.integers(2, 90))}}],
        }
        for name in names
    ]
    anchors = [{"name": "knob", "box": [draw(NUMBERS), draw(NUMBERS), 8, 9]}]
    return {"name": draw(st.text(max_size=20)), "picture": "panel.jpg", "anchors": anchors, "gauges": gauges}


@given(content=panels())
def test_valid_panel_survives_being_written_and_read(content: dict[str, Any]) -> None:
    """A panel written out as YAML again is the same panel."""
    panel = parse_panel(yaml.safe_dump(content, allow_unicode=True))
    again = parse_panel(yaml.safe_dump(panel.model_dump(mode="json", exclude_none=True), allow_unicode=True))

    assert again == panel
    assert [needle.name for needle in panel.needles] == [gauge["name"] for gauge in content["gauges"]]


GOOD = """
name: two dials
picture: panel.png
focal_length_mm: 4.45
level: [[330, 20], [330, 200]]
anchors:
  - {name: knob, box: [140, 12, 40, 40]}
gauges:
  - name: speed
    centre: [85, 110]
    radius: [20, 52]
    sweep: [120, 420]
    scale: [[120, 0], [420, 1000]]
    needles:
      - {name: speed_kt, template: {at: 214, span: 18}}
  - name: fuel
    centre: [235, 108]
    radius: [20, 52]
    sweep: [120, 420]
    scale: [[120, 0], [420, 3000]]
    needles:
      - {name: al_lb, template: {at: 200, span: 18}, covered_by: fr_lb}
      - {name: fr_lb, template: {at: 330, span: 18}, covered_by: zz_lb}
      - {name: zz_lb, template: {at: 330, span: 18}}
"""
