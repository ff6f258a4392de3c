"""The files that `decode` writes of a flight: their formats and names, and writing them completely.

The writer of a format is imported only when used, since the names that `--format` takes are needed at once.

Every file is made beside its final name and put in place only when all of them are complete, so that an interrupted
decode leaves nothing half-written. A link under one of the names is replaced, never followed. The same flight data
always give the same bytes.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path
from typing import IO, TYPE_CHECKING

from decoder.panel.errors import OutputError
from flight_file.reader import Flight
from flight_file.session import parse_segment_name
from flight_file.untrusted import file_name, printable, read_beside

if TYPE_CHECKING:
    from decoder.imaging.panel_pictures import PanelPictures
    from decoder.outputs.json_output import Provenance
    from decoder.outputs.report_truth import TruthSection
    from decoder.panel.camera import Camera
    from decoder.timeseries.flight_data import FlightData
    from flight_file.frame import Frame
    from flight_file.session import Session
    from flight_file.verification import RecordingCheck

Write = Callable[[IO[bytes]], None]
MakeWriter = Callable[["Decoded"], Write]

JOURNAL_SUFFIX = ".decode-journal"


def as_text(write: Callable[[IO[str]], None]) -> Write:
    """Turn a text writer into a binary one: UTF-8, line ends unchanged, lone surrogates escaped."""

    def write_bytes(stream: IO[bytes]) -> None:
        text = io.TextIOWrapper(stream, encoding="utf-8", errors="backslashreplace", newline="")
        write(text)
        text.flush()
        text.detach()

    return write_bytes


@dataclass(frozen=True, slots=True)
class Decoded:
    """A flight that was decoded, with everything an output may be made of.

    Attributes
    ----------
    camera
        None if the flight file has none.
    frames
        Reads the decoded frames again.
    check
        Verifies the flight's files.
    session
        The recording's own session record.
    with_images
        Whether files that can contain the pictures should.
    name
        What the files' names begin with.
    command
        The command that makes the report again.
    truth
        What the flight was compared with, if it was.
    film
        The name of the film beside the report; empty if there is none.
    """

    source: PanelPictures
    camera: Camera | None
    data: FlightData
    provenance: Provenance
    frames: Callable[[], Iterator[Frame]]
    check: Callable[[], Sequence[RecordingCheck]]
    session: Session
    with_images: bool = False
    name: str = "flight"
    command: str = ""
    truth: TruthSection | None = None
    film: str = ""


def _late(function: str, *parts: str, is_text: bool = False) -> MakeWriter:
    """Make a writer of a flight, or of these parts of it, whose function's module is imported on use."""

    def writer(decoded: Decoded) -> Write:
        module, _, name = function.partition(":")
        what = [attrgetter(part)(decoded) for part in parts] or [decoded]
        write = partial(getattr(import_module(f"decoder.outputs.{module}"), name), *what)
        return as_text(write) if is_text else write

    return writer


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of file.

    Attributes
    ----------
    write
        Makes its writer.
    needs
        The module that it requires, and the extra that provides it; None if everything is installed anyway.
    takes_images
        Whether it can contain the pictures.
    suffix
        The ending of its files' names, if that is not the format's own name.
    """

    write: MakeWriter
    needs: tuple[str, str] | None = None
    takes_images: bool = False
    suffix: str | None = None

    @property
    def lacking(self) -> str | None:
        """What has to be installed first, as a sentence; None if nothing."""
        if self.needs is None or find_spec(self.needs[0]) is not None:
            return None
        return f"needs {self.needs[0]}: pip install 'image-flight-recorder[{self.needs[1]}]'"


FORMATS: dict[str, Format] = {
    "csv": Format(_late("csv_output:write_csv", "data", is_text=True)),
    "mcap": Format(_late("mcap_output:write_mcap"), takes_images=True),
    "layout": Format(_late("mcap_output:write_layout", is_text=True), suffix="layout.json"),
    "html": Format(_late("report.report:write_report"), needs=("jinja2", "report")),
    "film": Format(_late("film:write_report_film"), needs=("av", "video"), suffix="film.mp4"),
    "parquet": Format(_late("parquet_output:write_parquet", "data", "provenance"), needs=("pyarrow", "parquet")),
}


def _beside(film: str) -> MakeWriter:
    """Make a writer of the report that shows the film beside it."""

    def writer(decoded: Decoded) -> Write:
        command = decoded.command.replace("--format html", "--format html,film")
        return FORMATS["html"].write(replace(decoded, film=film, command=command))

    return writer


DESCRIPTION = _late("json_output:write_json", "data", "provenance", is_text=True)
ALIGNMENT = _late("csv_output:write_alignment", "data", "source.optics.size_px", is_text=True)


def planned_files(name: str, formats: Sequence[str]) -> dict[str, MakeWriter]:
    """Return every file that is made of a flight with this name, and what makes its writer."""
    names = {each: f"{name}.{FORMATS[each].suffix or each}" for each in formats}
    files = {file: FORMATS[each].write for each, file in names.items()}
    if "html" in names and "film" in names:
        files[names["html"]] = _beside(names["film"])
    files[f"{name}.json"] = DESCRIPTION
    if "csv" in formats:
        files[f"{name}_alignment.tsv"] = ALIGNMENT
    return files


def write_all(directory: Path, writers: Mapping[str, Write]) -> list[Path]:
    """Write files by name into a directory, which is created if needed; return their paths.

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
                part.unlink(missing_ok=True)
                with part.open("xb") as stream:
                    write(stream)
            for part, final in zip(parts, finals, strict=True):
                part.replace(final)
    except OSError as error:
        raise _unwritable(directory, error) from error
    return finals


def refuse_unwritable(directory: Path, name: str) -> None:
    """Test whether a file of this name can be written into a directory, or that can be created; nothing is left behind.

    Raises
    ------
    OutputError
        If not.
    """
    there = next(path for path in (directory, *directory.absolute().parents) if path.exists())
    try:
        with _parts([there / name]) as (part,):
            part.unlink(missing_ok=True)
            part.touch()
    except OSError as error:
        raise _unwritable(directory, error) from error


def _unwritable(directory: Path, error: OSError) -> OutputError:
    return OutputError(f"{directory}: the flight data cannot be written: {error.strerror}; choose another with -o")


def part_of(final: Path) -> Path:
    """Return the name of a file while it is being written, which no flight file in work has."""
    return final.with_name(f".{final.name}.part")


@contextlib.contextmanager
def _parts(finals: list[Path]) -> Iterator[list[Path]]:
    parts = [part_of(final) for final in finals]
    try:
        yield parts
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


def output_name(flight: Flight) -> str:
    """Name the outputs after the recording, or after a single file that was renamed."""
    if _is_of_segments(flight):
        return file_name(flight.recording)
    return file_name(flight.paths[0].name.removesuffix(".part").removesuffix(".mcap"))


def _is_of_segments(flight: Flight) -> bool:
    return len(flight.paths) > 1 or parse_segment_name(flight.paths[0]) is not None


def refuse_another_recording(flight: Flight, directory: Path) -> None:
    """Refuse to replace the flight data of another recording with the same name.

    Raises
    ------
    OutputError
        Naming the other recording.
    """
    if not _is_of_segments(flight):
        return
    name, own = f"{output_name(flight)}.json", printable(flight.recording)
    try:
        found = json.loads(read_beside(directory, name))
    except (OSError, ValueError, RecursionError):
        return  # not one of our descriptions
    there = found.get("recording") if isinstance(found, dict) else None
    if isinstance(there, str) and there != own:
        raise OutputError(
            f"{directory / name}: is of the recording {there}, this one is {own}; choose another folder with -o"
        )


def refuse_overwriting(inputs: Sequence[Path], outputs: Sequence[Path]) -> None:
    """Refuse to replace an input by an output made from it.

    Raises
    ------
    OutputError
        Naming the file.
    """
    for path in inputs:
        if any(_are_one(path, each) for output in outputs for each in (output, part_of(output))):
            raise OutputError(f"{path}: would be overwritten; choose another name or folder for what is written")


def _are_one(one: Path, other: Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)
