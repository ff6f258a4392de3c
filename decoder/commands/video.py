"""`decode video FLIGHT -o FILE.mp4`: the film of a flight with its readings drawn in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import IO

import click

from decoder.commands.options import (
    asked_part,
    camera_option,
    end_option,
    end_with_losses,
    every_option,
    flights_argument,
    panel_option,
    start_option,
)
from decoder.outputs.film import NEEDS, Shown, Sounding, drawn_film, sound_beside, write_film
from decoder.outputs.frame_picture import matched_frames
from decoder.outputs.outputs import Decoded, refuse_overwriting, refuse_unwritable, write_all
from decoder.panel.errors import OutputError
from decoder.panel.vocabulary import Method
from decoder.parallel.decoding import decoded_flight, progress, written_flight
from decoder.timeseries.flight_part import AskedPart, TypedTime
from flight_file.frame import Frame
from flight_file.reader import Flight, open_flight
from flight_file.untrusted import say

EPILOG = """\b
H.264 in an MP4, each frame at its own time; the file's creation time is that of the first frame, if known.
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done with loss (the flight file is damaged or unfinished).

\b
Examples:
  decode video flight.mcap -o overlay.mp4
  decode video flight.mcap -o overlay.mp4 --data results
  decode video flight.mcap -o approach.mp4 --from 12:01:30Z --to 12:04:00Z --height 720
"""


@click.command("video", epilog=EPILOG)
@flights_argument
@click.option(
    "-o", "--output", "file", type=click.Path(path_type=Path, dir_okay=False), required=True, metavar="FILE",
    help="The film, an .mp4; one that is there is replaced.",
)  # fmt: skip
@click.option(
    "--data", "directory", type=click.Path(path_type=Path, file_okay=False, exists=True), metavar="DIR",
    help="Draw the flight data that `decode FLIGHT -o DIR` wrote, instead of decoding again.",
)  # fmt: skip
@click.option(
    "--height", "height_px", type=click.IntRange(min=120), default=1080, show_default=True, metavar="PX",
    help="Of the pictures, without the values below; frames are made smaller, never larger.",
)  # fmt: skip
@click.option(
    "--crf", type=click.IntRange(1, 51), default=21, show_default=True, metavar="N",
    help="Quality, as x264 counts: 18 looks as the frames do, each 6 more halve the file.",
)  # fmt: skip
@click.option(
    "--keep-sound", is_flag=True,
    help="Put in the sound that `recorder replay --keep-sound` stored, voices too; without it there is none.",
)  # fmt: skip
@start_option
@end_option
@every_option
@panel_option
@camera_option
def command(
    *,
    flights: tuple[Path, ...],
    file: Path,
    directory: Path | None,
    height_px: int,
    crf: int,
    keep_sound: bool,
    start: TypedTime | None,
    end: TypedTime | None,
    every: int,
    panel_file: Path | None,
    camera_file: Path | None,
) -> None:
    """Write FLIGHT as a film: each reading where it lies in the picture, in its status's colour; all values below."""
    if file.suffix.lower() != ".mp4":
        raise click.UsageError(f"{file}: a film is an MP4; give it a name that ends with .mp4")
    if find_spec("av") is None:
        raise OutputError(NEEDS)
    flight = open_flight(flights)
    given = [each for each in (panel_file, camera_file) if each is not None]
    refuse_overwriting([*flight.paths, *given], [file])
    part = asked_part(flight, AskedPart(start, end, every))
    refuse_unwritable(file.parent, file.name)
    if directory is None:
        decoded = decoded_flight(flight, panel_file, Method.NORMXCORR.value, camera_file, part=part)
        chosen = _all_rows
    else:
        decoded = written_flight(flight, directory, panel_file, camera_file, part)
        chosen = _known_rows
    frames = flight.count() if part is None else len(part.ranks)
    read, shown = decoded.frames, progress("film", frames)
    film = _Film(replace(decoded, frames=lambda: shown(read())), chosen, height_px, crf, flight if keep_sound else None)
    write_all(file.parent, {file.name: film.write})
    if keep_sound and not film.packets:
        _tell("no sound is kept in the flight file; `recorder replay --keep-sound` stores it")
    say(f"{film.drawn} of {frames} frames in {file}")
    end_with_losses(flight.losses)


Rows = Iterator[tuple[int, Frame]]
"""Frames, each with its row in the flight data."""


def _all_rows(decoded: Decoded) -> Rows:
    return enumerate(matched_frames(decoded.data, decoded.frames))


def _known_rows(decoded: Decoded) -> Rows:
    """Iterate over the frames in the flight data, and report the others."""
    rows = {number: row for row, number in enumerate(decoded.data.frame.tolist())}
    unknown = 0
    for frame in decoded.frames():
        if frame.sequence in rows:
            yield rows[frame.sequence], frame
        else:
            unknown += 1
    if unknown:
        _tell(f"{unknown} frames are not in the flight data, and so not in the film")


class _Film:
    """A film being written, with its numbers of frames and packets of sound, and the flight whose sound it gets."""

    def __init__(
        self, decoded: Decoded, chosen: Callable[[Decoded], Rows], height_px: int, crf: int, heard: Flight | None
    ) -> None:
        self._decoded, self._chosen, self._height_px, self._crf = decoded, chosen, height_px, crf
        self._heard = heard
        self.drawn = self.packets = 0

    def write(self, stream: IO[bytes]) -> None:
        """Write it to an existing file, which FFmpeg opens by its name."""
        data, rows = self._decoded.data, self._chosen(self._decoded)
        first = next(rows, None)
        began_ns = None if first is None or not data.knows_time_of_day else int(data.time_ns[first[0]])
        pictures = drawn_film(self._decoded, chain([] if first is None else [first], rows), self._height_px, _tell)
        write_film(self._counted(pictures), Path(stream.name), self._crf, began_ns, self._sound(first))

    def _sound(self, first: tuple[int, Frame] | None) -> Iterator[Sounding]:
        if self._heard is not None and first is not None:
            times_ns = self._decoded.data.time_ns
            for each in sound_beside(self._heard.heard(), int(times_ns[first[0]]), int(times_ns[-1])):
                self.packets += 1
                yield each

    def _counted(self, pictures: Iterator[Shown]) -> Iterator[Shown]:
        for each in pictures:
            self.drawn += 1
            yield each


def _tell(sentence: str) -> None:
    say(sentence, err=True)
