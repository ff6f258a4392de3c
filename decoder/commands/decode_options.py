"""The arguments that commands that decode a flight have in common; imports nothing that takes time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from decoder.formats import FORMATS
from decoder.method import Method
from decoder.typed_time import EXAMPLES, TypedTime, typed_time


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
start_option = click.option(
    "--from", "start", callback=_time, metavar="T",
    help=f"Only frames from T on: seconds or a clock from the flight's start, or UTC ({EXAMPLES}).",
)  # fmt: skip
end_option = click.option("--to", "end", callback=_time, metavar="T", help="Only frames up to T.")
every_option = click.option(
    "--every", type=click.IntRange(min=1), default=1, metavar="N",
    help="Only the first of them and every N-th from there.",
)  # fmt: skip
jobs_option = click.option(
    "--jobs", type=click.IntRange(min=1), metavar="N",
    help="Read with N processes.  [default: one for each core, one alone for a short flight]",
)  # fmt: skip
resume_option = click.option(
    "--resume", is_flag=True, help="Go on with an earlier decode of this flight that was broken off."
)
format_option = click.option(
    "--format", "formats", callback=_formats, default="csv", show_default=True, metavar="FORMAT,...",
    help=f"{', '.join(FORMATS)}, or several; the description is always NAME.json.",
)  # fmt: skip
images_option = click.option(
    "--with-images", is_flag=True, help="Put the pictures into NAME.mcap, too; needs --format mcap."
)


def refuse_unheld_images(formats: Sequence[str], *, with_images: bool) -> None:
    """Ends with wrong usage where pictures are wanted and no format can hold them."""
    if with_images and not any(FORMATS[name].takes_images for name in formats):
        raise click.UsageError("--with-images needs --format mcap")
