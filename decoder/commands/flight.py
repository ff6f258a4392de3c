"""`decode FLIGHT...`: a flight file in, flight data out."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import click
import cv2
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from decoder.csv_output import write_csv
from decoder.errors import PanelMissing
from decoder.flight_data import FlightData
from decoder.flight_decoder import decode_flight
from decoder.gauge_reader import Method
from decoder.json_output import Provenance, SourceFile, write_json
from decoder.outliers import find_outliers
from decoder.outputs import Write, as_text, write_all
from decoder.panel_pictures import PANEL_FILE, PanelPictures, panel_from_attachments, panel_from_file
from decoder.panel_reader import PanelReader
from decoder.summary import summary_table
from flight_file.frame import Frame
from flight_file.reader import Flight, open_flight
from flight_file.segments import parse_segment_name

EXIT_LOSS = 3
MAX_LISTED = 10
EPILOG = """\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode flight.mcap
  decode flight_0000.mcap flight_0001.mcap -o results
  decode flight.mcap --panel cockpit/panel.yaml --method xcorr
"""


def _csv(data: FlightData) -> Write:
    return as_text(partial(write_csv, data))


def _parquet(data: FlightData) -> Write:
    from decoder.parquet_output import write_parquet  # noqa: PLC0415 - half a second that only this format needs

    return partial(write_parquet, data)


WRITERS: dict[str, Callable[[FlightData], Write]] = {"csv": _csv, "parquet": _parquet}


def _formats(_context: click.Context, _option: click.Parameter, value: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(value.split(",")))
    unknown = [name for name in formats if name not in WRITERS]
    if unknown:
        raise click.BadParameter(f"{unknown[0]!r} is none of {', '.join(WRITERS)}")
    if "parquet" in formats and find_spec("pyarrow") is None:
        raise click.BadParameter("parquet needs pyarrow: pip install 'image-flight-recorder[parquet]'")
    return formats


@click.command("flight", epilog=EPILOG)
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FLIGHT...")
@click.option(
    "-o", "--output", "directory", type=click.Path(path_type=Path, file_okay=False), default=Path(), metavar="DIR",
    help="Where the flight data go; made if it is not there.  [default: the current folder]",
)  # fmt: skip
@click.option(
    "--panel", "panel_file", type=click.Path(path_type=Path), metavar="PANEL",
    help="A panel.yaml to read with, instead of the one the flight file carries.",
)  # fmt: skip
@click.option(
    "--method", type=click.Choice([method.value for method in Method]), default=Method.NORMXCORR.value,
    show_default=True, help="Normalized or plain cross-correlation; plain is for comparison.",
)  # fmt: skip
@click.option(
    "--format", "formats", callback=_formats, default="csv", show_default=True, metavar="FORMAT,...",
    help="csv, parquet (needs the extra `parquet`), or both; the description is always NAME.json.",
)  # fmt: skip
def command(
    flights: tuple[Path, ...], directory: Path, panel_file: Path | None, method: str, formats: tuple[str, ...]
) -> None:
    """Decode FLIGHT, one flight file or the segments of one recording, into NAME.csv and NAME.json.

    NAME is the recording's; a single file that was given another name keeps that one.
    """
    cv2.setNumThreads(1)  # the work for one frame is too small to share, and one thread gives the same bytes everywhere
    with threadpool_limits(1):
        flight = open_flight(flights)
        source = _panel(flight, panel_file)
        data = decode_flight(flight, PanelReader.from_panel(source, Method(method)), _progress)
        provenance = _provenance(flight, source, panel_file, method)
        name = _output_name(flight)
        writers = {f"{name}.{suffix}": WRITERS[suffix](data) for suffix in formats}
        writers[f"{name}.json"] = as_text(partial(write_json, data, provenance))
        written = write_all(directory, writers)
    _report(data, provenance, written)
    if provenance.losses:
        sys.exit(EXIT_LOSS)


def _output_name(flight: Flight) -> str:
    """The recording's name; of a single file that somebody named otherwise, that name."""
    if len(flight.paths) > 1 or parse_segment_name(flight.paths[0]) is not None:
        return flight.recording
    return flight.paths[0].name.removesuffix(".part").removesuffix(".mcap")


def _panel(flight: Flight, panel_file: Path | None) -> PanelPictures:
    if panel_file is not None:
        return panel_from_file(panel_file)
    if PANEL_FILE not in flight.attachments:
        raise PanelMissing(str(flight.paths[0]))
    return panel_from_attachments(flight.attachments, flight=flight.paths[0].name)


def _provenance(flight: Flight, source: PanelPictures, panel_file: Path | None, method: str) -> Provenance:
    camera = flight.attachments.get("camera.yaml")
    return Provenance(
        recording=flight.recording,
        software=f"image-flight-recorder {version('image-flight-recorder')}",
        method=method,
        flight_files=tuple(SourceFile(path.name, digest) for path, digest in flight.sha256_of_files().items()),
        panel=SourceFile(panel_file.name if panel_file else PANEL_FILE, source.sha256),
        camera=None if camera is None else SourceFile("camera.yaml", sha256(camera).hexdigest()),
        losses=tuple(f"{loss.path.name}: {loss.reason}" for loss in flight.losses),
    )


def _progress(frames: Iterator[Frame]) -> Iterator[Frame]:
    yield from tqdm(frames, desc="decode", unit=" frames", disable=None, leave=False)  # None: on a terminal only


def _report(data: FlightData, provenance: Provenance, written: list[Path]) -> None:
    click.echo(f"{provenance.recording}: {len(data.frame)} frames, {data.time_s[-1]:.2f} s\n")
    click.echo(summary_table(data))
    for missing in data.missing_frames[:MAX_LISTED]:
        click.echo(f"frame {missing.frame} missing: {missing.reason}", err=True)
    if len(data.missing_frames) > MAX_LISTED:
        click.echo(f"... and {len(data.missing_frames) - MAX_LISTED} more; all are in the JSON file", err=True)
    for outlier in find_outliers(data)[:MAX_LISTED]:
        click.echo(f"{outlier.needle} at frame {data.frame[outlier.first]}: {outlier.reason}", err=True)
    for loss in provenance.losses:
        click.echo(f"lost: {loss}", err=True)
    click.echo("\n" + "\n".join(str(path) for path in written))
