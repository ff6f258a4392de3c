"""Options that several `decode calibrate` commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeVar

import click
import cv2

from decoder.calibration.profile import Line
from decoder.outputs import Write
from decoder.pictures import GreyPicture

LINE_PARTS = 4
PICTURES = (".png", ".jpg")
Command = TypeVar("Command", bound=Callable[..., Any])


def line_option(_context: click.Context, _option: click.Parameter, value: str | None) -> Line | None:
    """`x0,y0,x1,y1` as a line."""
    if value is None:
        return None
    try:
        numbers = [float(part) for part in value.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != LINE_PARTS or numbers[:2] == numbers[2:]:
        raise click.BadParameter("give both ends as x0,y0,x1,y1 in pixels")
    return Line((numbers[0], numbers[1]), (numbers[2], numbers[3]))


def camera_output(command: Command) -> Command:
    """`-o CAMERA`: what is measured takes its place in that file."""
    return click.option(
        "-o", "--output", "camera_file", type=click.Path(path_type=Path, dir_okay=False), default="camera.yaml",
        show_default=True, metavar="CAMERA", help="The camera.yaml that this goes into; what else it says is kept.",
    )(command)  # fmt: skip


def picture_file(path: Path, picture: GreyPicture) -> Write:
    """A writer of a picture, in the format that the file's ending names.

    Raises
    ------
    click.BadParameter
        If it names none.
    """
    if path.suffix.lower() not in PICTURES:
        raise click.BadParameter(f"{path}: give the picture a name that ends in {' or '.join(PICTURES)}")
    encoded = cv2.imencode(path.suffix.lower(), picture)[1].tobytes()

    def write(stream: IO[bytes]) -> None:
        stream.write(encoded)

    return write
