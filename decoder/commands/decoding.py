"""What commands that decode a flight have in common: opening it, its panel and camera, and telling how far it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import click
import cv2
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from decoder.camera import CAMERA_FILE, Camera, parse_camera
from decoder.errors import CameraError, OutputError, PanelMissing
from decoder.flight_decoder import Progress, decode_flight
from decoder.formats import FORMATS, Decoded
from decoder.gauge_reader import Method
from decoder.json_output import Provenance, SourceFile
from decoder.panel_pictures import PANEL_FILE, PanelPictures, panel_from_attachments, panel_from_file
from decoder.panel_reader import PanelReader
from flight_file.frame import Frame
from flight_file.reader import Flight
from flight_file.segments import parse_segment_name


def _formats(_context: click.Context, _option: click.Parameter, value: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(value.split(",")))
    for name in formats:
        if name not in FORMATS:
            raise click.BadParameter(f"{name!r} is none of {', '.join(FORMATS)}")
        lacking = FORMATS[name].lacking
        if lacking is not None:
            raise click.BadParameter(f"{name} {lacking}")
    return formats


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


def decoded_flight(
    flight: Flight,
    panel_file: Path | None,
    method: str,
    camera_file: Path | None = None,
    *,
    shown: Progress | None = None,
) -> Decoded:
    """A flight with all it was decoded with; `shown` wraps its frames, by default to show progress on a terminal."""
    cv2.setNumThreads(1)  # the work for one frame is too small to share, and one thread gives the same bytes everywhere
    with threadpool_limits(1):
        camera, camera_source = _camera(flight, camera_file)
        source = replace(_panel(flight, panel_file), camera=camera)
        data = decode_flight(flight, PanelReader.from_panel(source, Method(method)), shown or progress("decode"))
        return Decoded(
            flight=flight,
            source=source,
            camera=camera,
            data=data,
            provenance=_provenance(flight, source, panel_file, camera_source, method),
        )


def output_name(flight: Flight) -> str:
    """The recording's name; of a single file that somebody named otherwise, that name."""
    if len(flight.paths) > 1 or parse_segment_name(flight.paths[0]) is not None:
        return flight.recording
    return flight.paths[0].name.removesuffix(".part").removesuffix(".mcap")


def refuse_overwriting(flight: Flight, outputs: Sequence[Path]) -> None:
    """Keeps the flight's files from being replaced by what is made of it.

    Raises
    ------
    OutputError
        Naming the file.
    """
    for path in flight.paths:
        if any(output.exists() and path.exists() and output.samefile(path) for output in outputs):
            raise OutputError(f"{path}: would be overwritten by what is decoded from it; choose another folder with -o")


def progress(words: str) -> Progress:
    """Shows how many frames went by, on a terminal only."""

    def shown(frames: Iterator[Frame]) -> Iterator[Frame]:
        yield from tqdm(frames, desc=words, unit=" frames", disable=None, leave=False)

    return shown


def _panel(flight: Flight, panel_file: Path | None) -> PanelPictures:
    if panel_file is not None:
        return panel_from_file(panel_file)
    if PANEL_FILE not in flight.attachments:
        raise PanelMissing(str(flight.paths[0]))
    return panel_from_attachments(flight.attachments, flight=flight.paths[0].name)


def _camera(flight: Flight, camera_file: Path | None) -> tuple[Camera | None, SourceFile | None]:
    """The camera that the command line names, or else the one that the flight carries."""
    if camera_file is not None:
        try:
            text = camera_file.read_bytes()
        except OSError as error:
            raise CameraError("", f"cannot be read: {error.strerror}", source=str(camera_file)) from error
        name, source = camera_file.name, str(camera_file)
    elif CAMERA_FILE in flight.attachments:
        text, name, source = flight.attachments[CAMERA_FILE], CAMERA_FILE, f"{CAMERA_FILE} in {flight.paths[0].name}"
    else:
        return None, None
    return parse_camera(text, source=source), SourceFile(name, sha256(text).hexdigest())


def _provenance(
    flight: Flight, source: PanelPictures, panel_file: Path | None, camera: SourceFile | None, method: str
) -> Provenance:
    return Provenance(
        recording=flight.recording,
        software=f"image-flight-recorder {version('image-flight-recorder')}",
        method=method,
        flight_files=tuple(SourceFile(path.name, digest) for path, digest in flight.sha256_of_files().items()),
        panel=SourceFile(panel_file.name if panel_file else PANEL_FILE, source.sha256),
        camera=camera,
        losses=tuple(f"{loss.path.name}: {loss.reason}" for loss in flight.losses),
    )
