"""`decode frames FLIGHT -o DIR`: pictures of the flight with the readings drawn in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import IO

import click

from decoder.commands.options import camera_option, end_with_losses, flights_argument, method_option, panel_option
from decoder.imaging.pictures import ColourPicture, colour_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.outputs.drawn_readings import DrawnGauge, ReadingPlaces
from decoder.outputs.frame_picture import (
    Rows,
    as_jpeg,
    caption,
    drawn,
    every,
    flagged,
    gauge_view,
    matched_frames,
    nearest,
    whole_view,
)
from decoder.outputs.outputs import Decoded, Write, write_all
from decoder.panel.errors import PictureError
from decoder.parallel.decoding import decoded_flight, known_flight, progress, written_flight
from decoder.timeseries.flight_data import FlightData
from flight_file.frame import Frame
from flight_file.reader import open_flight
from flight_file.untrusted import file_names, say

EPILOG = """\b
Names: NAME_FRAME_TIME.jpg, with --gauge NAME_FRAME_TIME_GAUGE.jpg; TIME is when the picture was taken, UTC.
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode frames flight.mcap -o pictures --every 20
  decode frames flight.mcap -o pictures --at 12.5 --at 13
  decode frames flight.mcap -o pictures --flagged --gauge fuel
  decode frames flight.mcap -o pictures --flagged --data results
"""


@click.command("frames", epilog=EPILOG)
@flights_argument
@click.option(
    "-o", "--output", "directory", type=click.Path(path_type=Path, file_okay=False), required=True, metavar="DIR",
    help="Where the pictures go; made if it is not there.",
)  # fmt: skip
@click.option(
    "--at", "at_s", type=float, multiple=True, metavar="T", help="The frame nearest to T seconds; repeatable."
)
@click.option("--flagged", "wants_flagged", is_flag=True, help="Frames with a value interpolated, missing or doubtful.")
@click.option(
    "--every", "step", type=click.IntRange(min=1), metavar="N", help="Every N-th frame; without a choice all."
)
@click.option("--gauge", "gauge_names", multiple=True, metavar="GAUGE", help="Only this gauge, enlarged; repeatable.")
@click.option(
    "--data", "data_directory", type=click.Path(path_type=Path, file_okay=False, exists=True), metavar="DIR",
    help="Draw the flight data that `decode FLIGHT -o DIR` wrote.  [default: those in the current folder, beside FLIGHT"
    " or where the pictures go, if they are of the same files; otherwise the flight is decoded]",
)  # fmt: skip
@panel_option
@camera_option
@method_option
def command(
    flights: tuple[Path, ...],
    directory: Path,
    at_s: tuple[float, ...],
    step: int | None,
    gauge_names: tuple[str, ...],
    *,
    data_directory: Path | None,
    panel_file: Path | None,
    camera_file: Path | None,
    method: str,
    wants_flagged: bool,
) -> None:
    """Decode FLIGHT and write its pictures with needles, values, status and score drawn in.

    What is drawn is what `decode FLIGHT` writes: where it has written that, it is read; otherwise the whole flight is
    decoded first.
    """
    if (bool(at_s), wants_flagged, step is not None).count(True) > 1:
        raise click.UsageError("choose one of --at, --flagged and --every")
    flight = open_flight(flights)
    near = [directory, directory.parent, Path(), flight.paths[0].parent]
    if data_directory is not None:
        decoded = written_flight(flight, data_directory, panel_file, camera_file, None)
        decoded = replace(decoded, frames=partial(_of_data, decoded))
    elif (there := known_flight(flight, near, panel_file, camera_file, method)) is not None:
        decoded, folder = there
        say(f"readings from {folder / decoded.name}.csv")
    else:
        decoded = decoded_flight(flight, panel_file, method, camera_file)
    known = [gauge.name for gauge in decoded.source.panel.gauges]
    for name in gauge_names:
        if name not in known:
            raise click.UsageError(f"the panel has no gauge {name}; it has {', '.join(known)}")
    rows = _rows(decoded.data, at_s, step, wants_flagged=wants_flagged)
    written = _write(decoded, rows, gauge_names, directory)
    say(f"{_counted(len(written), 'picture')} of {_counted(len(rows), 'frame')} in {directory}")
    end_with_losses(decoded.provenance.losses)


def _of_data(decoded: Decoded) -> Iterator[Frame]:
    """Yield the frames that are in the flight data: all, unless `decode` was given a part of the flight."""
    known = set(decoded.data.frame.tolist())
    return (frame for frame in decoded.frames() if frame.sequence in known)


def _rows(data: FlightData, at_s: tuple[float, ...], step: int | None, *, wants_flagged: bool) -> Rows:
    if at_s:
        return nearest(data, at_s)
    return flagged(data) if wants_flagged else every(data, step or 1)


def _write(decoded: Decoded, rows: Rows, gauge_names: Sequence[str], directory: Path) -> list[Path]:
    """Draw and write one frame after the other; a frame with a damaged picture is reported and left out."""
    data, wanted = decoded.data, set(rows.tolist())
    places = ReadingPlaces(decoded.source, data)
    reasons = {missing.frame: missing.reason for missing in data.missing_frames}
    written: list[Path] = []
    video = GroupDecoder()
    for index, frame in enumerate(progress("draw", len(data.frame))(matched_frames(data, decoded.frames))):
        if index not in wanted:
            continue
        stem = f"{decoded.name}_{frame.sequence:06d}_{_file_time(data, index)}"
        words = caption(data, index, decoded.provenance.recording)
        try:
            pictures = _pictures(
                colour_picture(encoded_of(frame), video),
                stem,
                places.frame(index),
                gauge_names,
                (words, reasons.get(frame.sequence, "")),
            )
        except PictureError as error:
            say(f"frame {frame.sequence} not drawn: {error}", err=True)
            continue
        written += write_all(directory, {name: _content(jpeg) for name, jpeg in pictures.items()})
    return written


def _pictures(
    picture: ColourPicture,
    stem: str,
    gauges: tuple[DrawnGauge, ...],
    gauge_names: Sequence[str],
    told: tuple[str, str],
) -> dict[str, bytes]:
    """Return JPEGs by name: one of the whole frame, or one of each requested gauge in it."""
    if not gauge_names:
        return {f"{stem}.jpg": as_jpeg(drawn(picture, whole_view(picture), gauges, told))}
    names = file_names(gauge_names)
    return {
        f"{stem}_{names[gauge.name]}.jpg": as_jpeg(drawn(picture, gauge_view(picture, gauge), [gauge], told))
        for gauge in gauges
        if gauge.name in names
    }


def _file_time(data: FlightData, row: int) -> str:
    if not data.knows_time_of_day:
        return f"{data.time_s[row]:09.3f}s"
    seconds, rest = divmod(int(data.time_ns[row]), 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{rest // 1_000_000:03d}Z"


def _content(jpeg: bytes) -> Write:
    def write(stream: IO[bytes]) -> None:
        stream.write(jpeg)

    return write


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"
