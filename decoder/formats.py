"""The files that `decode` can write of a flight, by the names that `--format` takes.

What writes them is imported when it is wanted: the names are needed before anything else.
"""

# ruff: noqa: PLC0415

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

from decoder.outputs import Write, as_text

if TYPE_CHECKING:
    from decoder.camera import Camera
    from decoder.flight_data import FlightData
    from decoder.json_output import Provenance
    from decoder.panel_pictures import PanelPictures
    from decoder.report.truth_section import TruthSection
    from flight_file.frame import Frame
    from flight_file.reader import Flight


@dataclass(frozen=True, slots=True)
class Decoded:
    """A flight that was decoded: all that an output may be made of.

    Attributes
    ----------
    flight
        Its frames can be read again.
    camera
        None if the flight file carries none.
    with_images
        Whether files that can hold the pictures shall.
    name
        What the files' names begin with.
    command
        The command that makes the report again.
    truth
        What the flight was held against, if it was.
    """

    flight: Flight
    source: PanelPictures
    camera: Camera | None
    data: FlightData
    provenance: Provenance
    with_images: bool = False
    name: str = "flight"
    command: str = ""
    truth: TruthSection | None = None

    def frames(self) -> Iterator[Frame]:
        """The frames that were decoded, once more."""
        return self.flight.frames(None if self.data.part is None else self.data.part.ranks)


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

    write: Callable[[Decoded], Write]
    needs: tuple[str, str] | None = None
    takes_images: bool = False
    suffix: str | None = None

    @property
    def lacking(self) -> str | None:
        """What has to be installed first, as a sentence; None if nothing."""
        if self.needs is None or find_spec(self.needs[0]) is not None:
            return None
        return f"needs {self.needs[0]}: pip install 'image-flight-recorder[{self.needs[1]}]'"


def _csv(decoded: Decoded) -> Write:
    from decoder.csv_output import write_csv

    return as_text(partial(write_csv, decoded.data))


def _parquet(decoded: Decoded) -> Write:
    from decoder.parquet_output import write_parquet

    return partial(write_parquet, decoded.data, decoded.provenance)


def _mcap(decoded: Decoded) -> Write:
    from decoder.mcap_output import Pictures, write_mcap

    height, width = decoded.source.picture.shape
    pictures = Pictures(
        frames=decoded.frames if decoded.with_images else None,
        size_px=(width, height),
        focal_length_mm=decoded.source.panel.focal_length_mm,
        camera=decoded.camera,
    )
    return partial(write_mcap, decoded.data, decoded.source, decoded.provenance, pictures)


def _layout(decoded: Decoded) -> Write:
    from decoder.foxglove_layout import write_layout

    units = [(series.quantity.name, series.quantity.unit) for series in decoded.data.series]
    return as_text(partial(write_layout, units))


def _html(decoded: Decoded) -> Write:
    from decoder.report.of_flight import report_of
    from decoder.report.report import write_report

    return partial(write_report, report_of(decoded))


def description(decoded: Decoded) -> Write:
    """The writer of `NAME.json`, which goes with every other file."""
    from decoder.json_output import write_json

    return as_text(partial(write_json, decoded.data, decoded.provenance))


def alignment(decoded: Decoded) -> Write:
    """The writer of `NAME_alignment.tsv`, which goes with `NAME.csv`."""
    from decoder.alignment_output import write_alignment

    height, width = decoded.source.picture.shape
    return as_text(partial(write_alignment, decoded.data, (width, height)))


FORMATS: dict[str, Format] = {
    "csv": Format(_csv),
    "mcap": Format(_mcap, takes_images=True),
    "layout": Format(_layout, suffix="layout.json"),
    "html": Format(_html, needs=("jinja2", "report")),
    "parquet": Format(_parquet, needs=("pyarrow", "parquet")),
}


def planned_files(name: str, formats: Sequence[str]) -> dict[str, Callable[[Decoded], Write]]:
    """Every file that is made of a flight with this name: what makes its writer, by the file's name."""
    files = {f"{name}.{FORMATS[each].suffix or each}": FORMATS[each].write for each in formats}
    files[f"{name}.json"] = description
    if "csv" in formats:
        files[f"{name}_alignment.tsv"] = alignment
    return files
