"""Arguments and options that several commands share; without slow imports."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from decoder.outputs.outputs import FORMATS
from decoder.panel.errors import PartError
from decoder.panel.vocabulary import AUTO, TIME_COLUMN, WINDOW_S, Method, Names
from decoder.timeseries.flight_part import EXAMPLES, AskedPart, FlightPart, TypedTime, part_of, typed_time
from flight_file.reader import Flight
from flight_file.untrusted import say

EXIT_LOSS = 3

flights_argument = click.argument(
    "flights", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FLIGHT..."
)
panel_option = click.option(
    "--panel", "panel_file", type=click.Path(path_type=Path), metavar="PANEL",
    help="A panel.yaml to read with, instead of the one the flight file carries.",
)  # fmt: skip
camera_option = click.option(
    "--camera", "camera_file", type=click.Path(path_type=Path), metavar="CAMERA",
    help="A camera.yaml of the camera that took the pictures, instead of the one the flight file carries.",
)  # fmt: skip
method_option = click.option(
    "--method", type=click.Choice([method.value for method in Method]), default=Method.NORMXCORR.value,
    show_default=True, help="Normalized or plain cross-correlation; plain is for comparison.",
)  # fmt: skip
every_option = click.option(
    "--every", type=click.IntRange(min=1), default=1, metavar="N",
    help="Only the first of them and every N-th from there.",
)  # fmt: skip
jobs_option = click.option(
    "--jobs", type=click.IntRange(min=1), metavar="N",
    help="Read with N processes.  [default: one for each core, one alone for a short flight]",
)  # fmt: skip
resume_option = click.option(
    "--resume", is_flag=True, help="Continue an earlier decode of this flight that was interrupted."
)
images_option = click.option(
    "--with-images", is_flag=True, help="Put the pictures into NAME.mcap, too; needs --format mcap."
)


def _offset(_context: click.Context, _option: click.Parameter, value: str | None) -> str | float | None:
    if value is None or value == AUTO:
        return value
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is neither auto nor a number of seconds") from error


def _names(_context: click.Context, _option: click.Parameter, value: str | None) -> Names | None:
    """Take a name as that of a file, unless it has an equals sign and there is no such file."""
    if value is None or "=" not in value or Path(value).exists():
        return None if value is None else Path(value)
    pairs = tuple((needle, column) for needle, _, column in (each.partition("=") for each in value.split(",")))
    if not all(needle and column for needle, column in pairs) or len(dict(pairs)) < len(pairs):
        raise click.BadParameter(f"{value!r} is not NEEDLE=COLUMN,... with each needle once")
    return pairs


_OPTIONS = (
    click.option("--map", "names", callback=_names, metavar="YAML|NEEDLE=COLUMN,...",
                 help="What the truth calls them."),
    click.option("--time", "time_column", metavar="COLUMN",
                 help=f"The truth's column of times.  [default: {TIME_COLUMN}]"),
    click.option("--offset", callback=_offset, metavar="auto|SECONDS", help="What to add to the truth's times."),
    click.option("--window", "window_s", type=click.FloatRange(min=1), default=WINDOW_S, show_default=True, metavar="S",
                 help="How far `--offset auto` looks, seconds to either side."),
    click.option("--limits", "wants_limits", is_flag=True, help="Judge parameters by published recorder accuracies."),
)  # fmt: skip


def truth_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add them: names, time_column, offset, window_s, wants_limits."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def _columns(_context: click.Context, _option: click.Parameter, values: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Parse statements by column: `alt_2_ft=altitude`, `airspeed_kt>160`, `airspeed_kt<45`."""
    said: dict[str, dict[str, Any]] = {}
    for value in values:
        found = _COLUMN.fullmatch(value)
        if found is None:
            raise click.BadParameter(f"{value!r} is none of NAME=PARAMETER, NAME>NUMBER and NAME<NUMBER")
        name, sign, what = found.groups()
        said.setdefault(name, {})[{"=": "means", ">": "above", "<": "below"}[sign]] = what
    return said


_COLUMN = re.compile(r"([A-Za-z][A-Za-z0-9_]*)\s*([=<>])\s*(.+)")
column_option = click.option(
    "--column", "columns", multiple=True, callback=_columns, metavar="NAME=PARAMETER|NAME>X|NAME<X",
    help="What a column means in the cross-checks, or a limit beyond which it is listed; repeatable, overrides the"
    " panel's `columns`.",
)  # fmt: skip


def _formats(_context: click.Context, _option: click.Parameter, value: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(value.split(",")))
    for name in formats:
        if name not in FORMATS:
            raise click.BadParameter(f"{name!r} is none of {', '.join(FORMATS)}")
        lacking = FORMATS[name].lacking
        if lacking is not None:
            raise click.BadParameter(f"{name} {lacking}")
    return formats


def _time(_context: click.Context, _option: click.Parameter, value: str | None) -> TypedTime | None:
    try:
        return None if value is None else typed_time(value)
    except ValueError as error:
        raise click.BadParameter(str(error)) from error


start_option = click.option(
    "--from", "start", callback=_time, metavar="T",
    help=f"Only frames from T on: seconds or a clock from the flight's start, or UTC ({EXAMPLES}).",
)  # fmt: skip
end_option = click.option("--to", "end", callback=_time, metavar="T", help="Only frames up to T.")


def asked_part(flight: Flight, asked: AskedPart) -> FlightPart | None:
    """Find the requested frames; None if they are all.

    Raises
    ------
    PartError
        If there are none, or a time of day was given that the flight does not know.
    """
    if not flight.session.knows_time_of_day and any(
        end is not None and end.since != "start" for end in (asked.start, asked.end)
    ):
        raise PartError(
            f"{flight.paths[0].name}: its time of day is unknown; give --from and --to in seconds from its first"
            " frame, such as 90 or 1:30"
        )
    return None if asked.is_whole else part_of(flight, asked)


format_option = click.option(
    "--format", "formats", callback=_formats, default="csv", show_default=True, metavar="FORMAT,...",
    help=f"{', '.join(FORMATS)}, or several; the description is always NAME.json.",
)  # fmt: skip


def end_with_losses(losses: Sequence[object]) -> None:
    """Report what was lost of a flight, and exit with the code for that; return if nothing was."""
    for loss in losses:
        say(f"lost: {loss}", err=True)
    if losses:
        sys.exit(EXIT_LOSS)


def refuse_unheld_images(formats: Sequence[str], *, with_images: bool) -> None:
    """Exit with a usage error if pictures are wanted and no format can contain them."""
    if with_images and not any(FORMATS[name].takes_images for name in formats):
        raise click.UsageError("--with-images needs --format mcap")


Command = TypeVar("Command", bound=Callable[..., Any])


def camera_output(command: Command) -> Command:
    """Add `-o CAMERA`: the measurements take their place in that file."""
    return click.option(
        "-o", "--output", "camera_file", type=click.Path(path_type=Path, dir_okay=False), default="camera.yaml",
        show_default=True, metavar="CAMERA", help="The camera.yaml that this goes into; what else it says is kept.",
    )(command)  # fmt: skip
