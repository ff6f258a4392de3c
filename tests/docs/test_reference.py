"""docs/reference is made from the code, and from the code as it is."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import Field

from decoder.cli import cli
from decoder.description import Strict
from docs_pages.commands import command_names, command_pages
from docs_pages.fields import UndescribedError, field_sections, kind
from docs_pages.reference import pages

FOLDER = Path(__file__).parents[2] / "docs" / "reference"


@pytest.mark.parametrize("name", pages())
def test_page_is_up_to_date(name: str) -> None:
    """It is what `make reference` writes; run that after a change of a command or of a key."""
    assert (FOLDER / name).read_text(encoding="utf-8") == pages()[name]


def test_every_command_has_its_place() -> None:
    """Those below other commands, too."""
    names = command_names("decode", cli)

    assert {"decode", "decode frames", "decode calibrate", "decode calibrate pose"} <= set(names)
    assert [name for name in names if f"\n## `{name}`\n" not in "\n" + command_pages("decode", cli)] == []


class Part(Strict):
    """A part."""

    places: tuple[tuple[float, float], ...] = ()
    """Where."""


class Whole(Strict):
    """A whole, in a word.

    And more of it.
    """

    count: int = Field(default=3, gt=0, le=9)
    """How many
    there are."""
    part: Part
    """What it is made of."""


class Undescribed(Strict):
    """Somebody forgot."""

    count: int


def test_fields_are_as_they_are_written() -> None:
    """Kind, default and description of each, and of the models that it is made of."""
    sections = field_sections(Whole)

    assert "## Whole\n\nA whole, in a word.\n" in sections
    assert "| `count` | whole number > 0 and <= 9 | 3 | How many there are. |" in sections
    assert "| `part` | [Part](#part) | must be there | What it is made of. |" in sections
    assert "| `places` | [[number, number], ...] |  | Where. |" in sections


def test_a_field_without_description_is_an_error() -> None:
    """One sentence says which it is."""
    with pytest.raises(UndescribedError, match=r"Undescribed\.count: write below it what it is for"):
        field_sections(Undescribed)


def test_every_key_of_recorder_yaml_is_there() -> None:
    """With its range, its default and what it is for."""
    page = pages()["recorder.yaml.md"]

    assert "| `interval_s` | number >= 0 and <= 3600 | 2.0 | Seconds from one still to the next;" in page
    assert "| `directory` | path | must be there |" in page
    assert {f"| `{key}` |" for key in ("driver", "segment_mib", "panel", "key", "shot_s", "pace")} <= {
        line[: line.index("|", 2) + 1] for line in page.splitlines() if line.startswith("| `")
    }


def test_choices_are_named() -> None:
    """Each once; what may be left out is no kind of its own."""
    assert kind({"anyOf": [{"enum": ["wide", "tele"]}, {"type": "number"}, {"type": "null"}]}) == (
        "`wide`, `tele` or number"
    )
