"""What is saved: a text that says what was drawn, files that are whole or untouched, names that lead nowhere else."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from decoder.panel.errors import OutputError, PanelError
from decoder.panel.panel import parse_panel
from decoder.setup.saving import panel_text, plain_name, save_files
from decoder.setup.session import NotValid, SavedElsewhere, SetupSession, WouldReplace
from decoder.setup.sources import open_source
from tests.programs import FIXTURES, yaml_of

numbers = st.floats(-5000, 5000).map(lambda value: round(value, 4)) | st.integers(-5000, 5000)
keys = st.from_regex(r"[a-z][a-z_]{0,11}", fullmatch=True)
words = st.text(st.characters(exclude_categories=("C", "Z")), max_size=20)
values = st.recursive(
    st.none() | st.booleans() | numbers | words,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.parametrize("panel", [FIXTURES / "panel.yaml", FIXTURES / "oblique" / "t1a_small" / "panel.yaml"])
def test_text_says_what_was_drawn(panel: Path) -> None:
    """A panel's content written and read again is the same panel."""
    content = yaml_of(panel)

    assert yaml.safe_load(panel_text(content)).keys() == content.keys()
    for gauge, own in zip(parse_panel(panel_text(content)).gauges, content["gauges"], strict=True):
        assert gauge.name == own["name"]
        assert [angle for angle, _ in gauge.scale] == pytest.approx(sorted(a for a, _ in own["scale"]), abs=1e-4)


@pytest.mark.slow
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])  # PyYAML is slow
@given(
    content=st.dictionaries(keys, values, max_size=6),
    gauges=st.lists(st.dictionaries(keys, values, min_size=1, max_size=4), max_size=3),
)
def test_any_content_comes_back(content: dict[str, Any], gauges: list[dict[str, Any]]) -> None:
    """Keys that the page does not know are kept, and values of any kind are read back as they were."""
    content = {key: value for key, value in content.items() if key not in ("gauges", "anchors", "reference_points")}
    whole = content | {
        "gauges": [{"name": "g"} | {key: gauge[key] for key in gauge if key != "needles"} for gauge in gauges]
    }

    assert yaml.safe_load(panel_text(whole)) == whole


ELSEWHERE = (
    "../panel.jpg",
    "/etc/passwd",
    "a/b.jpg",
    "..",
    ".hidden",
    "",
    "a\\b.jpg",
    "a\0.jpg",
    "CON",
    "a.jpg.",
    "\x1b",
)
DESCRIPTIONS = ("panel.yaml", "Panel.YAML", "camera.yaml", "recorder.yaml", "own.yaml")


@pytest.mark.parametrize(
    ("name", "says"),
    [*((name, "plain name") for name in ELSEWHERE), *((name, "holds no picture") for name in DESCRIPTIONS)],
)
def test_names_that_lead_elsewhere_are_refused(name: str, says: str) -> None:
    """A picture lies beside its panel.yaml and nowhere else, and takes the place of no description, however spelt."""
    with pytest.raises(PanelError, match=says):
        plain_name(name, "picture", target="own.yaml")


def test_files_are_whole_or_untouched(tmp_path: Path) -> None:
    """When one file cannot be put in place, panel.yaml is as it was and nothing is left behind."""
    (tmp_path / "panel.yaml").write_bytes(b"old")
    (tmp_path / "panel.jpg").mkdir()
    with pytest.raises(OutputError, match="cannot be saved"):
        save_files(tmp_path, {"panel.jpg": b"picture", "panel.yaml": b"new"})

    assert (tmp_path / "panel.yaml").read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panel.jpg", "panel.yaml"]


Document = dict[str, Any]
Begin = Callable[..., SetupSession]


@pytest.fixture
def document() -> Document:
    """The animation's panel."""
    content: Document = yaml_of(FIXTURES / "panel.yaml")
    return content


@pytest.fixture
def begin(tmp_path: Path) -> Begin:
    """Begins a set-up of a picture, its panel to be saved in a folder that may have files."""

    def make(panel: Path | None = None) -> SetupSession:
        return SetupSession(open_source([FIXTURES / "panel.jpg"]), panel, tmp_path / "panel.yaml")

    return make


def test_picture_called_panel_yaml_destroys_nothing(begin: Begin, document: Document, tmp_path: Path) -> None:
    """A draft whose picture is called panel.yaml is no panel yet."""
    with pytest.raises(NotValid, match="1 thing to correct before the panel can be saved: picture: cannot be"):
        begin().save({**document, "picture": "panel.yaml"}, "frame-0", 0, replaces=True)

    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["panel.yaml", "panel.jpg"])
@pytest.mark.parametrize("kind", ["file", "folder", "link", "pipe"])
def test_stranger_is_not_replaced_unless_it_is_said(
    begin: Begin, document: Document, tmp_path: Path, name: str, kind: str
) -> None:
    """What neither was opened nor saved here stays, until somebody says that it may go."""
    (tmp_path / "elsewhere").write_text("mine")
    match kind:
        case "file":
            (tmp_path / name).write_text("mine")
        case "folder":
            (tmp_path / name).mkdir()
        case "link":
            (tmp_path / name).symlink_to(tmp_path / "elsewhere")
        case "pipe":
            os.mkfifo(tmp_path / name)
    session = begin()
    with pytest.raises(WouldReplace, match=name):
        session.save(document, "frame-0", 0)
    with contextlib.suppress(OutputError):  # a folder is never replaced
        session.save(document, "frame-0", 0, replaces=True)

    assert (tmp_path / "elsewhere").read_text() == "mine"
    assert not (tmp_path / name).is_symlink()
    assert (tmp_path / name).is_dir() == (kind == "folder")
    assert session.revision == (0 if kind == "folder" else 1)


def test_opened_panel_is_saved_without_a_question(begin: Begin, document: Document, tmp_path: Path) -> None:
    """What was opened or saved here may be saved again and again; a picture that somebody changed meanwhile stays."""
    for name in ("panel.yaml", "panel.jpg"):
        (tmp_path / name).write_bytes((FIXTURES / name).read_bytes())
    session = begin(tmp_path / "panel.yaml")
    session.save({**document, "name": "first"}, "panel", 0)
    session.save({**document, "name": "second"}, "frame-0", 1)
    (tmp_path / "panel.jpg").write_bytes(b"somebody's own")
    with pytest.raises(WouldReplace, match=r"panel\.jpg"):
        session.save({**document, "name": "third"}, "frame-0", 2)

    assert yaml_of(tmp_path / "panel.yaml")["name"] == "second"


def test_link_that_a_panel_was_opened_through_stays_a_link(document: Document, tmp_path: Path) -> None:
    """What is saved is the panel that it leads to, with the pictures beside it."""
    shared, flight = tmp_path / "shared", tmp_path / "flight"
    shared.mkdir()
    flight.mkdir()
    SetupSession(open_source([FIXTURES / "thesis_a1.mcap"]), None, shared / "panel.yaml").save(document, "frame-0", 0)
    link = flight / "panel.yaml"
    link.symlink_to(shared / "panel.yaml")
    session = SetupSession(open_source([FIXTURES / "thesis_a1.mcap"]), link, link)
    session.save({**document, "name": "renamed"}, "panel", 0)

    assert link.is_symlink()
    assert yaml_of(shared / "panel.yaml")["name"] == "renamed"
    assert [path.name for path in flight.iterdir()] == ["panel.yaml"]


def test_file_changed_by_another_program_is_not_overwritten(begin: Begin, document: Document, tmp_path: Path) -> None:
    """What an editor wrote meanwhile is not lost silently either; saving over it must be asked for."""
    session = begin()
    session.save({**document, "name": "first"}, "frame-0", 0)
    (tmp_path / "panel.yaml").write_text("name: theirs\n", encoding="utf-8")
    with pytest.raises(SavedElsewhere):
        session.save({**document, "name": "second"}, "frame-0", 1)

    assert (tmp_path / "panel.yaml").read_text(encoding="utf-8") == "name: theirs\n"
