"""From a folder of photographs to one flight file, and back: what `recorder replay` and `recorder extract` do."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from flight_file.losses import Loss
from flight_file.reader import Flight, open_flight
from recorder.errors import FileNotWrittenError, ReplayNotPossibleError
from recorder.host import Host
from recorder.journal import Journal
from recorder.run import record
from recorder.settings import AttachSettings, RecorderConfig, ReplaySettings, StorageSettings
from recorder.stop import Stop

_NO_LIMIT = 1e9
"""Seconds or MiB: one file, however long or large."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """How many pictures are in the new flight file, and what the flights they come from have lost of theirs."""

    stored: int
    losses: tuple[Loss, ...]


@dataclass(frozen=True, slots=True)
class Extracted:
    """A picture that lies in a file of its own now."""

    path: Path
    sequence: int


def replay_into(
    target: Path, sources: Sequence[Path], *, rate_hz: float | None, attach: AttachSettings, host: Host, stop: Stop
) -> Replayed:
    """Record pictures into one flight file, named after it.

    Nothing is left behind where it fails.

    Parameters
    ----------
    target
        The flight file, `NAME.mcap`; must not be there yet.
    sources
        One folder of JPEGs, or flight files.
    rate_hz
        Pictures a second, for folders; None where EXIF tells when each was taken.
    attach
        The panel and camera to put into it.
    stop
        To end it from elsewhere.

    Raises
    ------
    ReplayNotPossibleError
        The target is there already, or is not named like a flight file; or it was stopped.
    FileNotWrittenError, FlightNotWrittenError
        The target cannot be written.
    CameraError
        A source cannot be read.
    """
    if target.suffix != ".mcap":
        raise ReplayNotPossibleError(f"{target}: a flight file ends in .mcap; name it so.")
    if target.exists():
        raise ReplayNotPossibleError(f"{target}: is there already; choose another name, or move it away.")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=".replay-", dir=target.parent) as directory:
            config = _config(Path(directory), sources, rate_hz=rate_hz, attach=attach)
            outcome = record(config, host=host, stop=stop, journal=Journal(io.StringIO()), name=target.stem)
            if stop.is_requested:
                raise ReplayNotPossibleError(f"{target}: {stop.reason}; nothing was written.")
            losses = () if sources[0].is_dir() else _losses(sources)
            (path,) = outcome.paths
            path.rename(target)
    except OSError as error:
        raise FileNotWrittenError(target, error) from error
    return Replayed(outcome.stored, losses)


def extract(flight: Flight, directory: Path) -> Iterator[Extracted]:
    """Write every picture of a flight as it was recorded, byte for byte; their names sort in its order.

    What cannot be read of the flight is among its `losses` afterwards.

    Raises
    ------
    ReplayNotPossibleError
        Another file has a picture's name; it is left as it is.
    FileNotWrittenError
        A picture cannot be written.
    """
    for frame in flight.frames():
        path = directory / f"{frame.sequence:06d}.jpg"
        try:
            if path.exists() and path.read_bytes() != frame.jpeg:
                raise ReplayNotPossibleError(f"{path}: is there already with another picture; choose another folder.")
            directory.mkdir(parents=True, exist_ok=True)
            path.write_bytes(frame.jpeg)
        except OSError as error:
            raise FileNotWrittenError(path, error) from error
        yield Extracted(path, frame.sequence)


def _losses(paths: Sequence[Path]) -> tuple[Loss, ...]:
    """What could not be read of flight files; a gap at an end shows nowhere else."""
    flight = open_flight(paths)
    deque(flight.frames(), maxlen=0)
    return tuple(flight.losses)


def _config(
    directory: Path, sources: Sequence[Path], *, rate_hz: float | None, attach: AttachSettings
) -> RecorderConfig:
    one = len(sources) == 1 and sources[0].is_dir()
    camera = ReplaySettings(driver="replay", path=sources[0] if one else list(sources), rate_hz=rate_hz, pace="fastest")
    storage = StorageSettings(directory=directory, keep_free_gib=0.0)
    unlimited = storage.model_copy(update={"segment_s": _NO_LIMIT, "segment_mib": _NO_LIMIT})
    return RecorderConfig(camera=camera, storage=unlimited, attach=attach)
