"""`recorder replay`: make one flight file of a folder of photographs, of a video, or of earlier flight files."""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from camera_drivers.errors import ReplayError
from camera_drivers.replay.camera import is_flight
from camera_drivers.replay.options import ReplaySettings
from flight_file.reader import open_flight
from flight_file.session import Original, Session
from flight_file.untrusted import say
from recorder.cli import DONE_WITH_LOSS, failures_as_sentences
from recorder.config import AttachSettings, RecorderConfig, StorageSettings
from recorder.errors import ConfigurationError, FileNotWrittenError, ReplayNotPossibleError
from recorder.host import Host, this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.supervision import Stop, stop_on_signals

_AS_IT_IS = ", and all of it as it is"
_NOT_AS_IT_IS = ", the sound itself is not"
_NO_LIMIT = 10**10
"""Seconds, MiB or pictures: one file, however long; three centuries, which is more than times in files can span."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """The pictures in the new flight file, the losses of their sources, and the videos among these."""

    stored: int
    losses: tuple[str, ...]
    originals: tuple[Original, ...] = ()
    knows_time_of_day: bool = True


def replay_into(
    target: Path,
    sources: Sequence[Path],
    *,
    attach: AttachSettings,
    host: Host,
    stop: Stop,
    **times: str | float | bool | None,
) -> Replayed:
    """Record pictures into one flight file, named after it.

    If it fails, no file is left behind.

    Parameters
    ----------
    target
        The flight file, `NAME.mcap`; must not be there yet.
    sources
        One folder of pictures, flight files, or video files.
    attach
        The panel and camera to put into it.
    stop
        To end it from elsewhere.
    times
        Further fields of `ReplaySettings`: when the pictures were taken, and whether sound is kept.

    Raises
    ------
    ReplayNotPossibleError
        The target is there already, or is not named like a flight file; or it was stopped.
    FileNotWrittenError, FlightNotWrittenError
        The target cannot be written.
    ConfigurationError
        A file to attach cannot be read.
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
            config = _config(Path(directory), sources, attach=attach, **times)
            outcome = record(config, host=host, stop=stop, journal=Journal(io.StringIO()), name=target.stem)
            if stop.is_requested:
                raise ReplayNotPossibleError(f"{target}: {stop.reason}; nothing was written.")
            (path,) = outcome.paths
            session = open_flight([path]).session
            losses = (*_losses(sources, session, outcome.stored), *_dropped(outcome))
            path.rename(target)
    except OSError as error:
        raise FileNotWrittenError(target, error) from error
    except ConfigurationError as error:
        if isinstance(error.__cause__, ReplayError):
            raise error.__cause__ from None  # the sources are named on a command line, not in a recorder.yaml
        raise
    return Replayed(outcome.stored, losses, session.originals, session.knows_time_of_day)


def _losses(paths: Sequence[Path], session: Session, stored: int) -> tuple[str, ...]:
    """Find what cannot be read of flight files or videos; a gap at the end of a flight file shows nowhere else."""
    if paths[0].is_dir():
        return ()
    if session.originals and not is_flight(paths[0]):
        return tuple(_cut_off(session.originals, stored))
    flight = open_flight(paths)
    deque(flight.frames(), maxlen=0)
    return tuple(loss.reason for loss in flight.losses)


def _dropped(outcome: Outcome) -> Iterator[str]:
    if outcome.dropped:
        yield f"{outcome.dropped} of the pictures, which are larger than a flight file takes"


def _cut_off(originals: Sequence[Original], stored: int) -> Iterator[str]:
    listed = [original.facts.get("pictures", "") for original in originals]
    if all(number.isdecimal() for number in listed) and sum(map(int, listed)) > stored:
        yield f"{sum(map(int, listed)) - stored} of the pictures that the index lists: a file is cut off or damaged"


def _config(
    directory: Path, sources: Sequence[Path], *, attach: AttachSettings, **times: str | float | bool | None
) -> RecorderConfig:
    one = len(sources) == 1 and sources[0].is_dir()
    path = sources[0] if one else list(sources)
    camera = ReplaySettings.model_validate({"driver": "replay", "path": path, "pace": "fastest", **times})
    storage = StorageSettings(directory=directory, keep_free_gib=0.0)
    unlimited = storage.model_copy(update=dict.fromkeys(("segment_s", "segment_mib", "segment_frames"), _NO_LIMIT))
    return RecorderConfig(camera=camera, storage=unlimited, attach=attach)


@click.command(
    epilog="""\b
Examples:
  recorder replay photographs -o flight.mcap
  recorder replay photographs -o flight.mcap --rate 0.5 --panel panel.yaml
  recorder replay flights/20180504T120000Z_*.mcap -o flight.mcap --panel panel.yaml
  recorder replay GX010123.MP4 GX020123.MP4 -o flight.mcap --start 2026-05-04T09:30:00Z

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 something is lost of what was replayed.""",
)
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "target", type=click.Path(path_type=Path), required=True, metavar="FLIGHT",
    help="The flight file to make; an existing file is never replaced.",
)  # fmt: skip
@click.option(
    "--rate", "rate_hz", type=click.FloatRange(1e-6, 1000), metavar="HZ",
    help="Pictures a second, for photographs whose EXIF times are missing or too coarse.",
)  # fmt: skip
@click.option("--start", metavar="TIME", help="When a video's first picture was taken, such as 2026-05-04T09:30:00Z.")
@click.option(
    "--clock", type=click.Choice(["creation", "timecode", "gps"]),
    help="Which of a video's clocks to trust; without this or --start the flight has no time of day.",
)  # fmt: skip
@click.option("--utc-offset", metavar="+HH:MM", help="By how much --start, or the trusted clock, is ahead of UTC.")
@click.option(
    "--keep-sound", is_flag=True,
    help="Store a video's sound as it is, voices too; without it only its strongest tones are stored.",
)  # fmt: skip
@click.option("--panel", type=click.Path(path_type=Path), help="A panel.yaml to put in, with the pictures it names.")
@click.option("--camera", type=click.Path(path_type=Path), help="A camera.yaml to put in.")
@click.pass_context
def replay(
    context: click.Context,
    /,
    *,
    sources: tuple[Path, ...],
    target: Path,
    panel: Path | None,
    camera: Path | None,
    **times: str | float | bool | None,
) -> None:
    """Make one flight file of a folder of photographs, of a video, or of earlier flight files.

    SOURCE is a folder whose pictures are taken in the order of their names, each at its EXIF time; the video files of
    one recording, H.264, H.265 or MJPEG, in any order; or the segments of a recording. The pictures go in as they are,
    never encoded again. Of a video's sound the strongest tones are kept, never speech.
    """
    with failures_as_sentences():
        attach = AttachSettings(panel=panel, camera=camera)
        stop = Stop()
        stop_on_signals(stop)
        replayed = replay_into(target, sources, attach=attach, host=this_host(), stop=stop, **times)
    say(f"{target}: {replayed.stored} pictures")
    for original in replayed.originals:
        say(f"  {original.name}:", *(f"    {name}: {fact}" for name, fact in original.facts.items()))
    if any(original.has_sound for original in replayed.originals):
        say(f"  sound: its strongest tones are in the flight{_AS_IT_IS if times['keep_sound'] else _NOT_AS_IT_IS}")
    if not replayed.knows_time_of_day:
        say("  time of day unknown: no clock is trusted unless --start or --clock says so")
    for loss in replayed.losses:
        say(f"  lost: {loss}", err=True)
    context.exit(DONE_WITH_LOSS if replayed.losses else 0)
