"""Writing flight data: `NAME.csv` and `NAME.json`, whole or not at all.

Every file is made beside its final name and put in place only when all of them are complete, so that a decode that is
broken off leaves nothing half-written. The same flight data always give the same bytes.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO

from decoder.errors import OutputError

Write = Callable[[IO[bytes]], None]
PART = ".part"


def as_text(write: Callable[[IO[str]], None]) -> Write:
    """A writer of text as one of bytes: UTF-8, line ends as they are written."""

    def write_bytes(stream: IO[bytes]) -> None:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        write(text)
        text.flush()
        text.detach()

    return write_bytes


def write_all(directory: Path, writers: Mapping[str, Write]) -> list[Path]:
    """Writes files by name into a directory, which is made if it is not there; returns their paths.

    Raises
    ------
    OutputError
        If any cannot be written; then none is.
    """
    finals = [directory / name for name in writers]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for final in finals:
            if final.is_dir():
                raise IsADirectoryError(0, f"{final.name} is a folder")
        with _parts(finals) as parts:
            for part, write in zip(parts, writers.values(), strict=True):
                with part.open("wb") as stream:
                    write(stream)
            for part, final in zip(parts, finals, strict=True):
                part.replace(final)
    except OSError as error:
        raise OutputError(
            f"{directory}: the flight data cannot be written: {error.strerror}; choose another with -o"
        ) from error
    return finals


@contextlib.contextmanager
def _parts(finals: list[Path]) -> Iterator[list[Path]]:
    parts = [final.with_name(final.name + PART) for final in finals]
    try:
        yield parts
    finally:
        for part in parts:
            part.unlink(missing_ok=True)
