"""The files that `decode` can write of a flight, by the names that `--format` takes.

What writes them is imported when it is wanted: the names are needed before anything else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from typing import TYPE_CHECKING

from decoder.outputs.outputs import Write, as_text

if TYPE_CHECKING:
    from decoder.imaging.panel_pictures import PanelPictures
    from decoder.outputs.json_output import Provenance
    from decoder.outputs.report_truth import TruthSection
    from decoder.panel.camera import Camera
    from decoder.timeseries.flight_data import FlightData
    from flight_file.frame import Frame
    from flight_file.session import Session
    from flight_file.verification import RecordingCheck

MakeWriter = Callable[["Decoded"], Write]


@dataclass(frozen=True, slots=True)
class Decoded:
    """A flight that was decoded: all that an output may be made of.

    Attributes
    ----------
    camera
        None if the flight file carries none.
    frames
        Reads the frames that were decoded once more.
    check
        Verifies the flight's files.
    session
        What the recording says of itself.
    with_images
        Whether files that can hold the pictures shall.
    name
        What the files' names begin with.
    command
        The command that makes the report again.
    truth
        What the flight was held against, if it was.
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


def _late(function: str, *parts: str, is_text: bool = False) -> MakeWriter:
    """Have a flight, or these parts of it, written by a function whose module is imported when it is wanted."""

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
        The module that it cannot do without, and the extra that brings it; None if all is there.
    takes_images
        Whether it can hold the pictures.
    suffix
        What its files' names end with, if not with the format's own name.
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
    "html": Format(_late("report:write_report"), needs=("jinja2", "report")),
    "parquet": Format(_late("parquet_output:write_parquet", "data", "provenance"), needs=("pyarrow", "parquet")),
}
DESCRIPTION = _late("json_output:write_json", "data", "provenance", is_text=True)
ALIGNMENT = _late("csv_output:write_alignment", "data", "source.optics.size_px", is_text=True)


def planned_files(name: str, formats: Sequence[str]) -> dict[str, MakeWriter]:
    """Name every file that is made of a flight with this name, and what makes its writer."""
    files = {f"{name}.{FORMATS[each].suffix or each}": FORMATS[each].write for each in formats}
    files[f"{name}.json"] = DESCRIPTION
    if "csv" in formats:
        files[f"{name}_alignment.tsv"] = ALIGNMENT
    return files
