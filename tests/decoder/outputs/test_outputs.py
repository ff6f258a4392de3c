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
    """A writer that breaks off after some bytes."""

    def write(stream: IO[bytes]) -> None:
        stream.write(b"half")
        raise error

    return write


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), RuntimeError("a bug"), SystemExit(1)], ids=lambda e: type(e).__name__
)
@pytest.mark.parametrize("order", [("good", "bad"), ("bad", "good")], ids=["bad last", "bad first"])
def test_broken_off_writer_leaves_nothing(tmp_path: Path, error: BaseException, order: tuple[str, str]) -> None:
    """Whatever breaks a writer off, neither half files nor half sets of files are left."""
    writers = {"good": says("all\n"), "bad": fails(error)}
    with pytest.raises(type(error)):
        write_all(tmp_path, {name: writers[name] for name in order})

    assert list(tmp_path.iterdir()) == []


def test_broken_off_writer_leaves_earlier_outputs_as_they_were(tmp_path: Path) -> None:
    """A decode that is interrupted does not spoil what an earlier one wrote."""
    write_all(tmp_path, {"a.csv": says("old\n"), "a.json": says("old\n")})
    with pytest.raises(KeyboardInterrupt):
        write_all(tmp_path, {"a.csv": says("new\n"), "a.json": fails(KeyboardInterrupt())})

    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.csv": "old\n", "a.json": "old\n"}


def test_full_disk_is_an_output_error(tmp_path: Path) -> None:
    """A write that fails names the directory, the reason and what to do, and leaves nothing."""
    with pytest.raises(OutputError, match=r"No space left on device; choose another with -o") as refused:
        write_all(tmp_path, {"a.csv": says("1\n"), "a.json": fails(OSError(28, "No space left on device"))})

    assert str(refused.value).startswith(f"{tmp_path}: ")
    assert list(tmp_path.iterdir()) == []


def test_final_name_that_cannot_be_taken_leaves_no_part(tmp_path: Path) -> None:
    """Where a directory has a final file's name, no file of the set is put in place and no part is left."""
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
