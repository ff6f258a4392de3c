"""Outputs: whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import IO

import pytest

from decoder.outputs.outputs import refuse_unwritable, write_all
from decoder.panel.errors import OutputError


def says(text: str) -> Callable[[IO[bytes]], None]:
    """A writer of a text."""

    def write(stream: IO[bytes]) -> None:
        stream.write(text.encode())

    return write


def fails(error: BaseException) -> Callable[[IO[bytes]], None]:
    """A writer that fails after some bytes."""

    def write(stream: IO[bytes]) -> None:
        stream.write(b"half")
        raise error

    return write


def test_broken_off_writer_leaves_earlier_outputs_as_they_were(tmp_path: Path) -> None:
    """Interrupted, or on a full disk, nothing incomplete is left; a full disk is reported, with advice."""
    write_all(tmp_path, {"a.csv": says("old\n"), "a.json": says("old\n")})
    with pytest.raises(KeyboardInterrupt):
        write_all(tmp_path, {"a.csv": says("new\n"), "a.json": fails(KeyboardInterrupt())})
    with pytest.raises(OutputError, match=rf"^{tmp_path}: .*No space left on device; choose another with -o"):
        write_all(tmp_path, {"b.csv": says("1\n"), "a.json": fails(OSError(28, "No space left on device"))})

    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.csv": "old\n", "a.json": "old\n"}


def test_final_name_that_cannot_be_taken_leaves_no_part(tmp_path: Path) -> None:
    """If a directory has a final file's name, no file of the set is put in place and no part is left."""
    (tmp_path / "a.json").mkdir()
    with pytest.raises(OutputError):
        write_all(tmp_path, {"a.csv": says("1\n"), "a.json": says("{}\n")})

    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("folder", ["out", "out/deeper"])
def test_folder_that_cannot_be_made_is_an_output_error(tmp_path: Path, folder: str) -> None:
    """A file in its place, or on the way to it, is left alone and named."""
    (tmp_path / "out").write_text("a file\n")
    with pytest.raises(OutputError, match=f"{folder}: the flight data cannot be written"):
        write_all(tmp_path / folder, {"a.csv": says("1\n")})
    with pytest.raises(OutputError, match=f"{folder}: the flight data cannot be written"):
        refuse_unwritable(tmp_path / folder, "a.csv")

    assert (tmp_path / "out").read_text() == "a file\n"
