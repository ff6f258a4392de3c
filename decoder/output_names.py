"""What the files are called that are made of a flight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from decoder.errors import OutputError
from flight_file.reader import Flight
from flight_file.segments import parse_segment_name


def output_name(flight: Flight) -> str:
    """The recording's name; of a single file that somebody named otherwise, that name."""
    if len(flight.paths) > 1 or parse_segment_name(flight.paths[0]) is not None:
        return flight.recording
    return flight.paths[0].name.removesuffix(".part").removesuffix(".mcap")


def refuse_overwriting(inputs: Sequence[Path], outputs: Sequence[Path]) -> None:
    """Keeps the flight's files, and whatever else is read with it, from being replaced by what is made of it.

    Raises
    ------
    OutputError
        Naming the file.
    """
    for path in inputs:
        if any(output.exists() and path.exists() and output.samefile(path) for output in outputs):
            raise OutputError(f"{path}: would be overwritten by what is decoded; choose another folder with -o")
