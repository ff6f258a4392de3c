"""Decoding one flight: with its panel and camera, and for a fleet from its store to that of the results."""

from __future__ import annotations

import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from socket import gethostname
from types import MappingProxyType
from typing import Any

import cv2
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures, panel_from_attachments, panel_from_file
from decoder.instruments.frame_batch import ReadBatches, read_here
from decoder.learning.fit import reader_from_panel
from decoder.learning.flight_sample import Tell
from decoder.outputs.csv_output import moment_text, read_back
from decoder.outputs.json_output import Provenance, SourceFile
from decoder.outputs.outputs import Decoded, output_name, planned_files, write_all
from decoder.panel.camera import Camera, parse_camera
from decoder.panel.errors import (
    CameraError,
    DecoderError,
    OutputError,
    PanelError,
    PanelMissing,
    PictureError,
    TableError,
)
from decoder.panel.lens import Lens
from decoder.panel.vocabulary import CAMERA_FILE, PANEL_FILE, Method
from decoder.parallel.flights import FleetFlight
from decoder.parallel.index import JOINED, Finished, Outcome, State, decoded_outcome, failed, from_marker, to_marker
from decoder.parallel.order import Order, installed, refuse_mismatch
from decoder.parallel.store import MARKER, join, parent, working_folder
from decoder.parallel.stores import store_of
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.flight_decoder import Progress, decode_flight
from decoder.timeseries.flight_part import FlightPart
from decoder.timeseries.tables import flight_table, read_table
from flight_file.errors import FlightFileError
from flight_file.frame import Frame
from flight_file.reader import Flight, open_flight
from flight_file.untrusted import printable, read_yaml_file
from flight_file.verification import verify


def decoded_flight(
    flight: Flight,
    panel_file: Path | None,
    method: str,
    camera_file: Path | None = None,
    *,
    shown: Progress | None = None,
    read: ReadBatches = read_here,
    part: FlightPart | None = None,
    columns: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> Decoded:
    """Decode a flight with its panel and camera.

    `shown` wraps its frames, by default to show progress on a terminal; `read` reads them, by default in this process;
    `part` says which, by default all; `columns` describes columns in addition to the panel.
    """
    cv2.setNumThreads(1)  # a frame is too little work to split, and one thread gives the same bytes everywhere
    with threadpool_limits(1), _stages(is_shown=shown is None) as tell, _named(panel_file):
        tell("reads the panel")
        camera, camera_source = _camera(flight, camera_file)
        source = replace(_panel(flight, panel_file), camera=camera)
        source = replace(source, panel=source.panel.with_columns(columns))
        data = decode_flight(
            flight,
            reader_from_panel(source, Method(method)),
            shown or progress("decode", flight.count() if part is None else len(part.ranks)),
            read=read,
            part=part,
            tell=tell,
        )
        return Decoded(
            source=source,
            camera=camera,
            data=data,
            provenance=_provenance(flight, source, panel_file, camera_source, method),
            frames=partial(flight.shown, None if part is None else part.ranks),
            check=partial(verify, flight.paths),
            session=flight.session,
            name=output_name(flight),
            command=_command(flight, panel_file, method, camera_file, data, columns=columns),
        )


def written_flight(
    flight: Flight, directory: Path, panel_file: Path | None, camera_file: Path | None, part: FlightPart | None
) -> Decoded:
    """Read back what `decode` wrote of a flight, with the same panel and camera.

    Its `frames` are those of the part, whether or not the flight data contain them.

    Raises
    ------
    TableError
        The directory does not contain the flight data, or they cannot be read.
    OutputError
        They are of another flight, panel or camera.
    """
    camera, camera_source = _camera(flight, camera_file)
    source = replace(_panel(flight, panel_file), camera=camera)
    name = output_name(flight)
    table = flight_table(read_table(directory / f"{name}.csv"))
    method = str(table.description.get("method", ""))
    provenance = _provenance(flight, source, panel_file, camera_source, method)
    _refuse_others(directory / f"{name}.json", table.description, provenance)
    optics, lenses = source.optics, dict[int, Lens | None]()
    if camera is not None:
        for frame in flight.shown():
            lenses[frame.sequence] = _lens(optics, frame)
    alignments = read_table(directory / f"{name}_alignment.tsv", "\t")
    return Decoded(
        source=source,
        camera=camera,
        data=read_back(table, alignments, source.panel, optics.size_px, lenses),
        provenance=provenance,
        frames=partial(flight.shown, None if part is None else part.ranks),
        check=partial(verify, flight.paths),
        session=flight.session,
        name=name,
    )


def known_flight(
    flight: Flight, folders: Sequence[Path], panel_file: Path | None, camera_file: Path | None, method: str
) -> tuple[Decoded, Path] | None:
    """Search folders for what `decode` wrote of a whole flight, with the same files, method and version of ours.

    Return what is read back, and its folder; None if there is none.
    """
    name = output_name(flight)
    for folder in dict.fromkeys(folders):
        if not (folder / f"{name}.csv").is_file():
            continue
        try:
            decoded = written_flight(flight, folder, panel_file, camera_file, None)
            description = flight_table(read_table(folder / f"{name}.csv")).description
        except (TableError, OutputError):
            continue  # of another flight, or unusable
        own = (decoded.provenance.software, method, None)
        if tuple(description.get(key) for key in ("software", "method", "part")) == own:
            return decoded, folder
    return None


def _lens(optics: Optics, frame: Frame) -> Lens | None:
    """Look up the lens that a frame was taken with; None if the camera's calibration does not cover it."""
    if frame.width_px is None or frame.height_px is None:
        return None
    size_px = (frame.width_px, frame.height_px)
    try:
        return optics.frame_lens(frame.exif.lens_mm, size_px[::-1] if frame.rotation_deg % 180 else size_px)
    except PictureError:
        return None


def _refuse_others(file: Path, description: Mapping[str, Any], own: Provenance) -> None:
    """Refuse flight data that were made from other inputs than those to be drawn on.

    Raises
    ------
    OutputError
        Saying what differs, and what to do.
    """
    remedies = {"flight_files": "decode this flight first", "panel": "give that with --panel"}
    remedies["camera"] = "give that with --camera"
    mine = asdict(own)
    for what, remedy in remedies.items():
        if _sha256_of(description.get(what)) != _sha256_of(mine[what]):
            raise OutputError(f"{file}: is of another {what.removesuffix('_files')}; {remedy}")


def _sha256_of(files: object) -> list[str]:
    listed = files if isinstance(files, list | tuple) else [] if files is None else [files]
    return [str(file.get("sha256")) if isinstance(file, dict) else "" for file in listed]


def progress(words: str, frames: int) -> Progress:
    """Show how many frames are done, how fast, and how long the rest will take, on a terminal only."""

    def shown(through: Iterator[Frame]) -> Iterator[Frame]:
        yield from tqdm(through, total=frames, desc=words, unit=" frames", disable=None, leave=False)

    return shown


@contextmanager
def _named(panel_file: Path | None) -> Iterator[None]:
    """Name the file in what is found wrong with a panel once its pictures are looked at."""
    try:
        yield
    except PanelError as error:
        if panel_file is None or error.source != PANEL_FILE:
            raise
        raise PanelError(error.path, error.problem, source=str(panel_file)) from error


@contextmanager
def _stages(*, is_shown: bool) -> Iterator[Tell]:
    """Show what is being done before frames are read, and for how long, on a terminal only."""
    if not is_shown:  # even a hidden bar creates a lock that outlives a killed process
        yield lambda _: None
        return
    with tqdm(bar_format="decode: {desc}  {elapsed}", disable=None, leave=False) as bar:

        def tell(words: str) -> None:
            if words:
                bar.set_description_str(words)
            else:
                bar.close()

        yield tell


def _command(
    flight: Flight,
    panel_file: Path | None,
    method: str,
    camera_file: Path | None,
    data: FlightData,
    *,
    columns: Mapping[str, Mapping[str, Any]],
) -> str:
    """Return the command that makes the report again, with file names only."""
    words = ["decode", *(path.name for path in flight.paths)]
    words += [] if panel_file is None else ["--panel", panel_file.name]
    words += [] if camera_file is None else ["--camera", camera_file.name]
    if data.part is not None:
        ends = ((int(data.time_ns[row]), float(data.time_s[row])) for row in (0, -1))
        first, last = (moment_text(data, time_ns) or f"{time_s:.6f}" for time_ns, time_s in ends)
        words += ["--from", first, "--to", last, "--every", str(data.part.ranks.step)]
    signs = {"means": "=", "above": ">", "below": "<"}
    for name, said in columns.items():
        words += [word for key, what in said.items() for word in ("--column", f"{name}{signs[key]}{what}")]
    return printable(shlex.join([*words, "--method", method, "--format", "html"]))


def _panel(flight: Flight, panel_file: Path | None) -> PanelPictures:
    if panel_file is not None:
        return panel_from_file(panel_file)
    if PANEL_FILE not in flight.attachments:
        raise PanelMissing(str(flight.paths[0]), flight.why_lost(PANEL_FILE))
    return panel_from_attachments(flight.attachments, flight=flight.paths[0].name, why_lost=flight.why_lost)


def _camera(flight: Flight, camera_file: Path | None) -> tuple[Camera | None, SourceFile | None]:
    """Read the camera that the command line names, or else the one in the flight."""
    if camera_file is not None:
        try:
            text = read_yaml_file(camera_file)
        except OSError as error:
            raise CameraError("", f"cannot be read: {error.strerror}", source=str(camera_file)) from error
        name, source = camera_file.name, str(camera_file)
    elif CAMERA_FILE in flight.attachments:
        text, name, source = flight.attachments[CAMERA_FILE], CAMERA_FILE, f"{CAMERA_FILE} in {flight.paths[0].name}"
    else:
        return None, None
    return parse_camera(text, source=source), SourceFile(printable(name), sha256(text).hexdigest())


def _provenance(
    flight: Flight, source: PanelPictures, panel_file: Path | None, camera: SourceFile | None, method: str
) -> Provenance:
    return Provenance(
        recording=printable(flight.recording),
        software=f"image-flight-recorder {version('image-flight-recorder')}",
        method=method,
        flight_files=tuple(
            SourceFile(printable(path.name), digest) for path, digest in flight.sha256_of_files().items()
        ),
        panel=SourceFile(printable(panel_file.name) if panel_file else PANEL_FILE, source.sha256),
        camera=camera,
        losses=tuple(printable(str(loss)) for loss in flight.losses),
    )


def decode_one(flight: FleetFlight, order: Order) -> Outcome:
    """Decode a flight, unless its results are already there; expected failures are reported in the outcome.

    Raises
    ------
    VersionMismatch
        If this process would decode differently from the one that asks.
    """
    refuse_mismatch(order.versions, installed(order.formats), f"the worker on {gethostname()}")
    threadpool_limits(1)  # for good: two flights in threads of one process would reset each other's limit
    begun = time.monotonic()
    try:
        return _ensured(flight, order, begun)
    except (DecoderError, FlightFileError) as error:
        return replace(failed(flight, str(error)), seconds=_since(begun))
    except OSError as error:
        return replace(failed(flight, f"{type(error).__name__}: {error}"), seconds=_since(begun))


def _ensured(flight: FleetFlight, order: Order, begun: float) -> Outcome:
    folder = join(order.output, flight.name)
    output, source = store_of(folder), store_of(flight.addresses[0])
    stamps = tuple(map(source.stamp, flight.addresses))
    earlier = from_marker(output.read(join(folder, MARKER)))
    if earlier is not None and earlier.still_holds(order.key, stamps):
        return replace(earlier.outcome, status=State.KEPT)
    known = [] if earlier is None else earlier.files
    _refuse_strangers(folder, output.strangers(folder, known), flight)
    with _staging(flight) as staged:
        opened = open_flight(source.fetch(flight.addresses, staged))
        if earlier is not None and earlier.may_hold(order.key, stamps) and _digests(opened) == earlier.outcome.sha256:
            _mark_again(replace(earlier, stamps=stamps), folder)
            return replace(earlier.outcome, status=State.KEPT)
        decoded = _decoded(opened, order, staged)
        with output.results(folder, known) as working:
            outputs = _write(decoded, order.formats, working)
            outcome = replace(
                decoded_outcome(flight, decoded, outputs),
                size_bytes=sum(stamp.size_bytes for stamp in stamps),
                seconds=_since(begun),
            )
            _mark(Finished(order.key, stamps, outcome), working)
    return outcome


def _decoded(opened: Flight, order: Order, staged: Path) -> Decoded:
    panel, camera = (
        None if given is None else given.fetched(staged / kind)
        for given, kind in ((order.panel, "panel"), (order.camera, "camera"))
    )
    decoded = decoded_flight(opened, panel, order.method, camera, shown=iter)
    return replace(decoded, with_images=order.with_images)


def _write(decoded: Decoded, formats: Sequence[str], working: Path) -> list[str]:
    files = planned_files(decoded.name, formats)
    write_all(working, {name: writer(decoded) for name, writer in files.items()})
    return sorted(files)


@contextmanager
def _staging(flight: FleetFlight) -> Iterator[Path]:
    """Make a temporary folder; failures in it are reported with the flight's address."""
    with working_folder() as folder:
        try:
            yield folder
        except (DecoderError, FlightFileError) as error:
            told = str(error).replace(str(folder), parent(flight.addresses[0]))
            raise DecoderError(told) from error


def _refuse_strangers(folder: str, strangers: list[str], flight: FleetFlight) -> None:
    if strangers:
        raise OutputError(
            f"{folder}: holds {strangers[0]}, which is no result of {flight.name}; "
            "move it away or choose another folder with -o"
        )


def _digests(opened: Flight) -> str:
    return JOINED.join(opened.sha256_of_files().values())


def _mark(finished: Finished, folder: Path) -> Path:
    marker = folder / MARKER
    marker.write_text(to_marker(finished), encoding="utf-8")
    return marker


def _mark_again(finished: Finished, folder: str) -> None:
    with working_folder() as working:
        store_of(folder).put(_mark(finished, working), join(folder, MARKER))


def _since(begun: float) -> float:
    return round(time.monotonic() - begun, 3)
