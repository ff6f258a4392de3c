"""What commands that decode a flight have in common: opening it, its panel and camera, and telling how far it is."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import cv2
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from decoder.attachments import CAMERA_FILE, PANEL_FILE
from decoder.camera import Camera, parse_camera
from decoder.csv_output import utc_text
from decoder.errors import CameraError, PanelMissing
from decoder.flight_data import FlightData
from decoder.flight_decoder import Progress, decode_flight
from decoder.flight_part import FlightPart
from decoder.formats import Decoded
from decoder.frame_batch import ReadBatches, read_here
from decoder.json_output import Provenance, SourceFile
from decoder.method import Method
from decoder.output_names import output_name
from decoder.panel_pictures import PanelPictures, panel_from_attachments, panel_from_file
from decoder.panel_reader import PanelReader
from flight_file.frame import Frame
from flight_file.reader import Flight


def decoded_flight(
    flight: Flight,
    panel_file: Path | None,
    method: str,
    camera_file: Path | None = None,
    *,
    shown: Progress | None = None,
    read: ReadBatches = read_here,
    part: FlightPart | None = None,
) -> Decoded:
    """A flight with all it was decoded with.

    `shown` wraps its frames, by default to show progress on a terminal; `read` reads them, by default in this process;
    `part` is which, by default all.
    """
    cv2.setNumThreads(1)  # the work for one frame is too small to share, and one thread gives the same bytes everywhere
    with threadpool_limits(1):
        camera, camera_source = _camera(flight, camera_file)
        source = replace(_panel(flight, panel_file), camera=camera)
        data = decode_flight(
            flight,
            PanelReader.from_panel(source, Method(method)),
            shown or progress("decode", flight.count() if part is None else len(part.ranks)),
            read=read,
            part=part,
        )
        return Decoded(
            flight=flight,
            source=source,
            camera=camera,
            data=data,
            provenance=_provenance(flight, source, panel_file, camera_source, method),
            name=output_name(flight),
            command=_command(flight, panel_file, method, camera_file, data),
        )


def progress(words: str, frames: int) -> Progress:
    """Shows how many of the frames went by, how fast, and how long the others will take, on a terminal only."""

    def shown(through: Iterator[Frame]) -> Iterator[Frame]:
        yield from tqdm(through, total=frames, desc=words, unit=" frames", disable=None, leave=False)

    return shown


def _command(flight: Flight, panel_file: Path | None, method: str, camera_file: Path | None, data: FlightData) -> str:
    """What to type to get the report again; files by their names alone, wherever they are."""
    words = ["decode", *(path.name for path in flight.paths)]
    words += [] if panel_file is None else ["--panel", panel_file.name]
    words += [] if camera_file is None else ["--camera", camera_file.name]
    if data.part is not None:
        first, last = (utc_text(int(data.time_ns[row])) for row in (0, -1))
        words += ["--from", first, "--to", last, "--every", str(data.part.ranks.step)]
    return shlex.join([*words, "--method", method, "--format", "html"])


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
