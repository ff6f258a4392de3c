"""`recorder recover` and `recorder extract`: get recordings out of damaged files, and pictures out of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flight_file.errors import FlightFileError
from flight_file.frame import JPEG, VIDEO_FORMATS, SoundPacket
from flight_file.reader import Flight, open_flight
from flight_file.salvage import Outcome, Recovery, recover_segment
from flight_file.signature import Signer
from flight_file.untrusted import file_name, read_beside, say, say_json
from flight_file.video.sound import playable
from recorder.cli import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.config import EvidenceSettings
from recorder.errors import FileNotWrittenError, ReplayNotPossibleError
from recorder.host import SystemClock
from recorder.plan import configured_signer

_SUFFIXES = {JPEG: ".jpg", "png": ".png", "webp": ".webp", "h264": ".h264", "h265": ".h265"}
_SENTENCES = {
    Outcome.RECOVERED: "{source}: {frames} frames recovered into {path}",
    Outcome.FINISHED: "{source}: was whole, {frames} frames; it is {path} now",
    Outcome.NOTHING_TO_DO: "{source}: is whole, nothing to do",
    Outcome.IN_WORK: "{source}: is being written by a recorder, left alone",
}


@click.command(
    epilog="""\b
Examples:
  recorder recover /var/lib/recorder/*.part
  recorder recover --json damaged.mcap | jq .[0].path

\b
Exit codes: 0 done, 1 a file could not be recovered, 2 wrong usage, 3 done with loss.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--key",
    type=click.Path(path_type=Path),
    help="Sign the part that the file proves to be recorded with this private key.",
)
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of lines.")
@click.pass_context
def recover(context: click.Context, files: tuple[Path, ...], key: Path | None, *, as_document: bool) -> None:
    """Repair what a power cut left behind: every frame that is whole, byte for byte, in a finished flight file.

    NAME.mcap.part becomes NAME.mcap, unless a recorder is writing it at this moment. A damaged NAME.mcap is kept, and
    what is whole of it goes into NAME.recovered.mcap.

    With --key, frames that no checkpoint of that key proves are not signed: they go into NAME.mcap.unproven, or, if
    nothing is proven, the whole file stays unsigned.
    """
    with failures_as_sentences():
        signer = configured_signer(EvidenceSettings(key=key))
    done: list[dict[str, Any]] = []
    failed = with_loss = False
    for file in files:
        try:
            recovery = recover_segment(file, at=SystemClock().read(), signer=signer)
        except FlightFileError as error:
            failed = True
            say(f"Error: {error}", err=True)
            continue
        done.append(_as_json(recovery))
        with_loss = with_loss or bool(recovery.losses or recovery.unproven) or _stays_unsigned(recovery, signer)
        if not as_document:
            say(*_lines(recovery, signer))
    if as_document:
        say_json(done)
    context.exit(FAILED if failed else DONE_WITH_LOSS if with_loss else 0)


def _stays_unsigned(recovery: Recovery, signer: Signer | None) -> bool:
    return signer is not None and not recovery.signed and recovery.outcome in (Outcome.RECOVERED, Outcome.FINISHED)


def _lines(recovery: Recovery, signer: Signer | None) -> list[str]:
    lines = [
        _SENTENCES[recovery.outcome].format(
            source=recovery.source.name, path=recovery.path.name, frames=recovery.frames
        )
    ]
    lines += [f"  lost: {loss.reason} (byte {loss.offset})" for loss in recovery.losses]
    if recovery.unproven is not None:
        lines.append(f"  not proven: {recovery.unproven_frames} frames, set apart in {recovery.unproven.name}")
    if _stays_unsigned(recovery, signer):
        lines.append("  not signed: nothing in the file proves that this key recorded it")
    return lines


def _as_json(recovery: Recovery) -> dict[str, Any]:
    return {
        "source": str(recovery.source),
        "path": str(recovery.path),
        "outcome": recovery.outcome.value,
        "frames": recovery.frames,
        "signed": recovery.signed,
        "unproven": str(recovery.unproven) if recovery.unproven is not None else None,
        "unproven_frames": recovery.unproven_frames,
        "losses": [
            {"offset": loss.offset, "length_bytes": loss.length, "kind": loss.kind.value, "reason": loss.reason}
            for loss in recovery.losses
        ],
    }


@click.command(
    epilog="""\b
Examples:
  recorder extract flights/20180504T120000Z_*.mcap -o photographs

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 something of the flight is lost.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "directory", type=click.Path(path_type=Path), required=True, metavar="FOLDER",
    help="Where the pictures go.",
)  # fmt: skip
@click.pass_context
def extract(context: click.Context, files: tuple[Path, ...], directory: Path) -> None:
    """Take the pictures out of a flight, byte for byte as they were recorded, named by their number.

    A video becomes one file, a stream that players and ffmpeg read; the times of its pictures are in the flight alone.
    Sound that was kept as it is becomes another, named after its codec.
    """
    with failures_as_sentences():
        flight = open_flight(files)
        count = extract_pictures(flight, directory)
        packets = extract_sound(flight, directory)
    say(f"{directory}: {count} pictures{f', {packets} packets of sound' if packets else ''}")
    for loss in flight.losses:
        say(f"  lost: {loss.reason}", err=True)
    context.exit(DONE_WITH_LOSS if flight.losses else 0)


def extract_pictures(flight: Flight, directory: Path) -> int:
    """Write every picture of a flight as it was recorded, byte for byte; return how many there are.

    Their names sort in the flight's order. Parts that cannot be read are among the flight's `losses` afterwards.

    Raises
    ------
    ReplayNotPossibleError
        Another file has a picture's name; it is left as it is.
    FileNotWrittenError
        A picture cannot be written.
    """
    count, begun = 0, set[Path]()
    for frame in flight.frames():
        is_video = frame.format in VIDEO_FORMATS
        name = file_name(flight.recording) if is_video else file_name(f"{frame.sequence:06d}")
        path = directory / (name + _SUFFIXES[frame.format])
        try:
            directory.mkdir(parents=True, exist_ok=True)
            with path.open("ab" if path in begun else "xb") as stream:  # a file or link of this name is left as it is
                stream.write(frame.encoded)
        except FileExistsError as error:
            if is_video or not _holds(path, frame.encoded):
                raise ReplayNotPossibleError(
                    f"{path}: is there already with another picture; choose another folder."
                ) from error
        except OSError as error:
            raise FileNotWrittenError(path, error) from error
        if is_video:
            begun.add(path)
        count += 1
    return count


def extract_sound(flight: Flight, directory: Path) -> int:
    """Write the packets of sound, where they were kept, one after the other; return how many there are.

    Raises
    ------
    ReplayNotPossibleError
        A file has that name already; it is left as it is.
    FileNotWrittenError
        They cannot be written.
    """
    count, path = 0, directory
    try:
        for packet in flight.heard():
            if isinstance(packet, SoundPacket):
                path = directory / file_name(f"{flight.recording}.{packet.codec}")
                with path.open("ab" if count else "xb") as stream:
                    stream.write(playable(packet))
                count += 1
    except FileExistsError as error:
        raise ReplayNotPossibleError(f"{path}: is there already; choose another folder.") from error
    except OSError as error:
        raise FileNotWrittenError(path, error) from error
    return count


def _holds(path: Path, jpeg: bytes) -> bool:
    try:
        return read_beside(path.parent, path.name) == jpeg
    except OSError:
        return False
