"""docs/reference is made from the code, and from the code as it is."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from decoder.commands.cli import cli as decode
from docs_pages.commands import command_names, command_pages
from docs_pages.reference import pages
from recorder.cli import main as recorder

PAGES = pages()
FOLDER = Path(__file__).parents[2] / "docs" / "reference"


@pytest.mark.parametrize("name", PAGES)
def test_page_is_up_to_date(name: str) -> None:
    """It is what `make reference` writes; run that after a change of a command or of a key."""
    assert (FOLDER / name).read_text(encoding="utf-8") == PAGES[name]


@pytest.mark.parametrize(("name", "program"), [("decode", decode), ("recorder", recorder)])
def test_every_command_has_its_place_and_shows_how_it_is_used(name: str, program: click.Group) -> None:
    """Those below other commands, too."""
    page = "\n" + command_pages(name, program)
    sections = dict(re.findall(r"\n## `([^`]+)`\n(.*?)(?=\n## |$)", page, re.DOTALL))

    assert list(sections) == command_names(name, program)
    assert [command for command, section in sections.items() if "  Examples:\n" not in section] == []
