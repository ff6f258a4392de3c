"""`recorder replay`: make one flight file of a folder of photographs, or of earlier flight files."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from camera_drivers.errors import ReplayError
from flight_file.errors import Loss
from flight_file.reader import open_flight
from flight_file.untrusted import say
from recorder.cli import DONE_WITH_LOSS, failures_as_sentences
from recorder.config import AttachSettings, RecorderConfig, ReplaySettings, StorageSettings
from recorder.errors import ConfigurationError, FileNotWrittenError, ReplayNotPossibleError
from recorder.host import Host, this_host
from recorder.journal import Journal
from recorder.run import record
from recorder.supervision import Stop, stop_on_signals

_NO_LIMIT = 10**10
"""Seconds, MiB or pictures: one file, however long; three centuries, which is more than times in files can span."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """How many pictures are in the new flight file, and what the flights they come from have lost of theirs."""

    stored: int
    losses: tuple[Loss, ...]


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
    ConfigurationError
        What is to be attached cannot be read.
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
    except ConfigurationError as error:
        if isinstance(error.__cause__, ReplayError):
            raise error.__cause__ from None  # the sources stand on a command line, not in a recorder.yaml
        raise
    return Replayed(outcome.stored, losses)


def _losses(paths: Sequence[Path]) -> tuple[Loss, ...]:
    """Find what cannot be read of flight files; a gap at an end shows nowhere else."""
    flight = open_flight(paths)
    deque(flight.frames(), maxlen=0)
    return tuple(flight.losses)


def _config(
    directory: Path, sources: Sequence[Path], *, rate_hz: float | None, attach: AttachSettings
) -> RecorderConfig:
    one = len(sources) == 1 and sources[0].is_dir()
    camera = ReplaySettings(driver="replay", path=sources[0] if one else list(sources), rate_hz=rate_hz, pace="fastest")
    storage = StorageSettings(directory=directory, keep_free_gib=0.0)
    unlimited = storage.model_copy(update=dict.fromkeys(("segment_s", "segment_mib", "segment_frames"), _NO_LIMIT))
    return RecorderConfig(camera=camera, storage=unlimited, attach=attach)


@click.command(
    epilog="""\b
Examples:
  recorder replay photographs -o flight.mcap
  recorder replay photographs -o flight.mcap --rate 0.5 --panel panel.yaml
  recorder replay flights/20180504T120000Z_*.mcap -o flight.mcap --panel panel.yaml

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 something is lost of the flights that were replayed.""",
)
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "target", type=click.Path(path_type=Path), required=True, metavar="FLIGHT",
    help="The flight file to make; what is there already is never replaced.",
)  # fmt: skip
@click.option(
    "--rate", "rate_hz", type=click.FloatRange(1e-6, 1000), metavar="HZ",
    help="Pictures a second, for photographs whose EXIF times are missing or too coarse.",
)  # fmt: skip
@click.option("--panel", type=click.Path(path_type=Path), help="A panel.yaml to put in, with the pictures it names.")
@click.option("--camera", type=click.Path(path_type=Path), help="A camera.yaml to put in.")
@click.pass_context
def replay(
    context: click.Context,
    *,
    sources: tuple[Path, ...],
    target: Path,
    rate_hz: float | None,
    panel: Path | None,
    camera: Path | None,
) -> None:
    """Make one flight file of a folder of photographs, or of earlier flight files.

    SOURCE is a folder whose JPEGs are taken in the order of their names, each at its EXIF time, or the segments of a
    recording. The pictures go in byte for byte.
    """
    with failures_as_sentences():
        attach = AttachSettings(panel=panel, camera=camera)
        stop = Stop()
        stop_on_signals(stop)
        replayed = replay_into(target, sources, rate_hz=rate_hz, attach=attach, host=this_host(), stop=stop)
    say(f"{target}: {replayed.stored} pictures")
    for loss in replayed.losses:
        say(f"  lost: {loss.reason}", err=True)
    context.exit(DONE_WITH_LOSS if replayed.losses else 0)
