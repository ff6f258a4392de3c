"""`decode FLIGHT...`: a flight file in, flight data out."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click

from decoder.commands.decoding import (
    camera_option,
    decoded_flight,
    flights_argument,
    format_option,
    images_option,
    method_option,
    output_name,
    panel_option,
    refuse_overwriting,
    refuse_unheld_images,
)
from decoder.flight_data import FlightData
from decoder.formats import planned_files
from decoder.json_output import Provenance
from decoder.outliers import find_outliers
from decoder.outputs import write_all
from decoder.summary import summary_table
from flight_file.reader import open_flight

EXIT_LOSS = 3
MAX_LISTED = 10
EPILOG = """\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode flight.mcap
  decode flight_0000.mcap flight_0001.mcap -o results
  decode flight.mcap --panel cockpit/panel.yaml --method xcorr
  decode flight.mcap -o results --format csv,mcap --with-images
"""


@click.command("flight", epilog=EPILOG)
@flights_argument
@click.option(
    "-o", "--output", "directory", type=click.Path(path_type=Path, file_okay=False), default=Path(), metavar="DIR",
    help="Where the flight data go; made if it is not there.  [default: the current folder]",
)  # fmt: skip
@panel_option
@camera_option
@method_option
@format_option
@images_option
def command(
    *,
    flights: tuple[Path, ...],
    directory: Path,
    panel_file: Path | None,
    camera_file: Path | None,
    method: str,
    formats: tuple[str, ...],
    with_images: bool,
) -> None:
    """Decode FLIGHT, one flight file or the segments of one recording, into NAME.csv and NAME.json.

    NAME is the recording's; a single file that was given another name keeps that one.
    """
    refuse_unheld_images(formats, with_images=with_images)
    flight = open_flight(flights)
    files = planned_files(output_name(flight), formats)
    refuse_overwriting(flight, [directory / file for file in files])
    decoded = replace(decoded_flight(flight, panel_file, method, camera_file), with_images=with_images)
    written = write_all(directory, {file: writer(decoded) for file, writer in files.items()})
    _report(decoded.data, decoded.provenance, written)
    if decoded.provenance.losses:
        sys.exit(EXIT_LOSS)


def _report(data: FlightData, provenance: Provenance, written: list[Path]) -> None:
    click.echo(f"{provenance.recording}: {len(data.frame)} frames, {data.time_s[-1]:.2f} s\n")
    click.echo(summary_table(data))
    for missing in data.missing_frames[:MAX_LISTED]:
        click.echo(f"frame {missing.frame} missing: {missing.reason}", err=True)
    if len(data.missing_frames) > MAX_LISTED:
        click.echo(f"... and {len(data.missing_frames) - MAX_LISTED} more; all are in the JSON file", err=True)
    for outlier in find_outliers(data)[:MAX_LISTED]:
        click.echo(f"{outlier.needle} at frame {data.frame[outlier.first]}: {outlier.reason}", err=True)
    for warning in data.warnings:
        click.echo(f"warning: {warning}", err=True)
    for loss in provenance.losses:
        click.echo(f"lost: {loss}", err=True)
    click.echo("\n" + "\n".join(str(path) for path in written))
