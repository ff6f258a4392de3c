"""`decode FLIGHT...`: a flight file in, flight data out.

Slow imports are made after the flight has been opened and named.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from decoder.commands.options import (
    EXIT_LOSS,
    asked_part,
    camera_option,
    column_option,
    end_option,
    every_option,
    flights_argument,
    format_option,
    images_option,
    jobs_option,
    method_option,
    panel_option,
    refuse_unheld_images,
    resume_option,
    start_option,
    truth_options,
)
from decoder.outputs.outputs import (
    JOURNAL_SUFFIX,
    output_name,
    planned_files,
    refuse_another_recording,
    refuse_overwriting,
    refuse_unwritable,
)
from decoder.panel.errors import PanelMissing
from decoder.panel.vocabulary import PANEL_FILE, Names, TruthRequest
from decoder.parallel import fork_server
from decoder.parallel.processes import ends_at_once, jobs_for
from decoder.timeseries.flight_part import AskedPart, FlightPart, TypedTime
from flight_file.frame import VIDEO_FORMATS
from flight_file.reader import Flight, open_flight
from flight_file.untrusted import say

_PIXELS_OF_A_BYTE = 10  # of a cockpit's JPEG
EPILOG = """\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode flight.mcap
  decode flight_0000.mcap flight_0001.mcap -o results
  decode flight.mcap --panel cockpit/panel.yaml --method xcorr
  decode flight.mcap -o results --format csv,mcap --with-images
  decode flight.mcap --from 12:01:30Z --to 12:04:00Z --every 4
  decode flight.mcap -o results --format csv,html --truth truth.csv
  decode flight.mcap -o results --format csv,html --column 'airspeed_kt>160' --column left_ft=altitude
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
@start_option
@end_option
@every_option
@column_option
@jobs_option
@click.option(
    "--truth", "truth_file", type=click.Path(path_type=Path), metavar="CSV",
    help="The truth to compare the flight with in the report, as `decode accuracy` does; needs --format html.",
)  # fmt: skip
@truth_options
@resume_option
def command(
    *,
    flights: tuple[Path, ...],
    directory: Path,
    panel_file: Path | None,
    camera_file: Path | None,
    method: str,
    formats: tuple[str, ...],
    with_images: bool,
    start: TypedTime | None,
    end: TypedTime | None,
    every: int,
    columns: Mapping[str, Mapping[str, Any]],
    jobs: int | None,
    truth_file: Path | None,
    names: Names | None,
    time_column: str | None,
    offset: str | float | None,
    window_s: float,
    wants_limits: bool,
    resume: bool,
) -> None:
    """Decode FLIGHT, one flight file or the segments of one recording, into NAME.csv and NAME.json.

    NAME is the recording's; a single file that was given another name keeps that one.
    """
    refuse_unheld_images(formats, with_images=with_images)
    truth = _truth(truth_file, names, time_column, offset, window_s, wants_limits=wants_limits, formats=formats)
    flight = open_flight(flights)
    files = planned_files(output_name(flight), formats)
    given = [file for file in (panel_file, camera_file, truth_file, names) if isinstance(file, Path)]
    written = [*files, output_name(flight) + JOURNAL_SUFFIX]
    refuse_overwriting([*flight.paths, *given], [directory / file for file in written])
    refuse_another_recording(flight, directory)
    panel, part = _panel(flight, panel_file), asked_part(flight, AskedPart(start, end, every))
    refuse_unwritable(directory, written[0])
    say(f"{flight.recording}: decoding {_frames(flight, part)} with {panel}")
    jobs = jobs_for(_picture_bytes(flight, part), asked=jobs)
    if jobs > 1:
        fork_server.begin()  # it loads the libraries while this process does
    with ends_at_once():
        from decoder.commands.flight_work import decode_and_write  # noqa: PLC0415 - as the module's first lines say
    with_loss = decode_and_write(
        flight,
        directory,
        files,
        panel_file=panel_file,
        camera_file=camera_file,
        method=method,
        with_images=with_images,
        jobs=jobs,
        part=part,
        truth=truth,
        resume=resume,
        columns=columns,
    )
    if with_loss:
        sys.exit(EXIT_LOSS)


def _truth(
    file: Path | None,
    names: Names | None,
    time_column: str | None,
    offset: str | float | None,
    window_s: float,
    *,
    wants_limits: bool,
    formats: tuple[str, ...],
) -> TruthRequest | None:
    """Gather what the report compares the flight with; refuse options that are useless without another."""
    if file is None and (names or time_column or offset is not None or wants_limits):
        raise click.UsageError("--map, --time, --offset and --limits need a --truth")
    if file is not None and "html" not in formats:
        raise click.UsageError("--truth needs --format html; without a report there is `decode accuracy`")
    return None if file is None else TruthRequest(file, names, time_column, offset, window_s, wants_limits)


def _panel(flight: Flight, panel_file: Path | None) -> str:
    """Name the panel in words; raises PanelMissing if there is none."""
    if panel_file is None and PANEL_FILE not in flight.attachments:
        raise PanelMissing(str(flight.paths[0]), flight.why_lost(PANEL_FILE))
    return "the panel it carries" if panel_file is None else str(panel_file)


def _frames(flight: Flight, part: FlightPart | None) -> str:
    files = f" in {len(flight.paths)} files" if len(flight.paths) > 1 else ""
    return f"{flight.count()} frames{files}" if part is None else f"{len(part.ranks)} of {flight.count()} frames{files}"


def _picture_bytes(flight: Flight, part: FlightPart | None) -> int:
    """Estimate the bytes of pictures to be read; for a video, as if they were JPEGs."""
    whole = sum(segment.size_bytes for segment in flight.segments)
    first = next(flight.frames(range(1)), None)
    if first is not None and first.format in VIDEO_FORMATS:
        whole = flight.count() * (first.width_px or 0) * (first.height_px or 0) // _PIXELS_OF_A_BYTE
    return whole if part is None else whole * len(part.ranks) // part.frames_in_flight
