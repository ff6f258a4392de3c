"""One file of a flight: its statements about itself, and the places of its chunks."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from flight_file.errors import FlightNotReadableError, Loss, LossKind
from flight_file.messages import PROFILE
from flight_file.records import ByteSource, ChunkPlace, FileSource
from flight_file.scan import Checkpoint, FileScan, scan_file
from flight_file.session import (
    ATTACHMENTS_RECORD,
    DIGEST_KEY,
    END_RECORD,
    SESSION_RECORD,
    EndRecord,
    Session,
    claimed_place,
    end_from_metadata,
    is_sound,
    sealed,
    session_from_metadata,
    start_of_segment,
)
from flight_file.thresholds import BLOCK_BYTES
from flight_file.untrusted import open_regular


@dataclass(frozen=True, slots=True)
class Segment:
    """One file of a flight.

    Attributes
    ----------
    session
        From its `session` record; if that is lost, recording and segment number come from the file's name.
    end
        From its `end` record; None if there is none.
    finished
        Whether the file ends as MCAP requires.
    size_bytes
        Of the file when it was opened.
    losses
        What was lost outside the chunks.
    start_of_chain
        Value of the chain before the first frame; empty if there is no chain, or a record it starts from is lost.
    checkpoints
        All checkpoints in the file, genuine or not (see `verification`).
    is_ours
        Whether it says that a recorder wrote it: profile `flight`.
    lost_attachments
        Names of attachments that it says it carries, but of which no undamaged copy is in it.
    places
        Offset and length of each record in the data section by opcode, bytes: what an index must list.
    end_of_data
        Where the data section ends; None if it has no end.
    """

    path: Path
    session: Session
    end: EndRecord | None
    finished: bool
    size_bytes: int
    chunks: tuple[ChunkPlace, ...]
    losses: tuple[Loss, ...]
    start_of_chain: str = ""
    checkpoints: tuple[Checkpoint, ...] = ()
    is_ours: bool = True
    lost_attachments: tuple[str, ...] = ()
    places: Mapping[int, Sequence[tuple[int, int]]] = field(default_factory=dict)
    end_of_data: int | None = None


@contextmanager
def opened(path: Path) -> Iterator[ByteSource]:
    """Open a file for reading at any position.

    Raises
    ------
    FlightNotReadableError
        If it cannot be opened, is no regular file, or fails while it is read inside the `with` block.
    """
    try:
        descriptor = open_regular(path)
    except OSError as error:
        raise FlightNotReadableError(path, reason=_advice(error)) from error
    try:
        yield FileSource(descriptor)
    except OSError as error:
        raise FlightNotReadableError(path, reason=_advice(error)) from error
    finally:
        os.close(descriptor)


def open_segment(path: Path) -> tuple[Segment, dict[str, bytes]]:
    """Open a file and return its segment and the attachments that are whole.

    Raises
    ------
    FlightNotReadableError, NotAFlightError
        If the file cannot be read, or is not MCAP.
    """
    with opened(path) as source:
        return segment_of(scan_file(path, source))


def segment_of(scan: FileScan) -> tuple[Segment, dict[str, bytes]]:
    """Interpret a scan as a segment and the attachments that are whole."""
    losses = list(scan.losses)
    session = _session(scan, losses)
    end = _end(scan, losses)
    attachments = _attachments(scan, losses)
    segment = Segment(
        path=scan.path,
        session=session,
        end=end,
        finished=scan.finished,
        size_bytes=scan.size_bytes,
        chunks=tuple(scan.chunks),
        losses=tuple(losses),
        start_of_chain=_start_of_chain(scan, session),
        checkpoints=tuple(scan.checkpoints),
        is_ours=scan.profile == PROFILE,
        lost_attachments=tuple(name for name in _promised(scan) if name not in attachments),
        places=scan.places,
        end_of_data=scan.end_of_data,
    )
    return segment, attachments


def _start_of_chain(scan: FileScan, session: Session) -> str:
    records = [scan.metadata.get(name, {}) for name in (SESSION_RECORD, ATTACHMENTS_RECORD)]
    if not session.chain or not all(map(is_sound, records)):
        return ""
    return start_of_segment(session.chain, *(record[DIGEST_KEY] for record in records))


def attachment_digests(scan: FileScan, attachments: Mapping[str, bytes]) -> dict[str, str]:
    """Return the record that lists the attachments: the file's or, if that is damaged, a new one."""
    stated = scan.metadata.get(ATTACHMENTS_RECORD, {})
    if is_sound(stated):
        return stated
    return sealed({name: hashlib.sha256(content).hexdigest() for name, content in attachments.items()})


def digest_of(source: ByteSource) -> str:
    """Compute the SHA-256 of all bytes, hexadecimal."""
    digest = hashlib.sha256()
    for offset in range(0, source.size, BLOCK_BYTES):
        digest.update(source.read_at(offset, min(BLOCK_BYTES, source.size - offset)))
    return digest.hexdigest()


def _advice(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "there is no such file; check the name"
    if isinstance(error, IsADirectoryError):
        return (
            "is a directory; give the flight files in it, or make one of its photographs: recorder replay DIRECTORY -o"
            " FLIGHT.mcap"
        )
    if error.errno == errno.EIO:  # a copy with zeros in it is damaged there, and read everywhere else
        return f"cannot be read ({error.strerror}): its disk fails; copy it with ddrescue, and give the copy"
    return f"cannot be read ({error.strerror}); check the file and its permissions"


def _by_name(path: Path) -> Session:
    recording, segment = claimed_place(path) or (path.name.removesuffix(".part").removesuffix(".mcap"), 0)
    return Session(recording=recording, segment=segment)


def _session(scan: FileScan, losses: list[Loss]) -> Session:
    record = scan.metadata.get(SESSION_RECORD, {})
    if is_sound(record):
        try:
            return session_from_metadata(record)
        except (KeyError, ValueError):
            pass
    if record or scan.profile == PROFILE:
        reason = "the session record is lost; recording and segment number are taken from the file's name"
        losses.append(Loss(scan.path, 0, 0, reason, LossKind.DAMAGED))
    return _by_name(scan.path)


def _end(scan: FileScan, losses: list[Loss]) -> EndRecord | None:
    end = _end_record(scan)
    if end is not None:
        if not scan.finished and not losses:
            reason = "the index at its end is cut; the pictures are whole"
            losses.append(Loss(scan.path, scan.size_bytes, 0, reason, LossKind.TRUNCATED))
        return end
    if SESSION_RECORD in scan.metadata or not scan.finished:
        reason = "there is no end record: the recording was cut off, or still runs"
        losses.append(Loss(scan.path, 0, 0, reason, LossKind.NO_END))
    return None


def _end_record(scan: FileScan) -> EndRecord | None:
    record = scan.metadata.get(END_RECORD, {})
    try:
        return end_from_metadata(record) if is_sound(record) else None
    except (KeyError, ValueError):
        return None


def _attachments(scan: FileScan, losses: list[Loss]) -> dict[str, bytes]:
    whole = {name: attachment.data for name, attachment in scan.attachments.items()}
    record = scan.metadata.get(ATTACHMENTS_RECORD)
    if record is None:
        return whole
    if not is_sound(record):
        reason = "the list of attachments is damaged; they are checked by their CRCs alone"
        losses.append(Loss(scan.path, 0, 0, reason, LossKind.DAMAGED))
        return whole
    promised = _promised(scan)
    for name in _unfitting(promised, whole):
        whole.pop(name, None)
        losses.append(Loss(scan.path, 0, 0, f"the attachment {name!r} is lost", LossKind.DAMAGED))
    for name in sorted(whole.keys() - promised):
        del whole[name]
        reason = f"the attachment {name!r} is not in the list of attachments"
        losses.append(Loss(scan.path, 0, 0, reason, LossKind.DAMAGED))
    return whole


def _promised(scan: FileScan) -> dict[str, str]:
    record = scan.metadata.get(ATTACHMENTS_RECORD, {})
    return {name: digest for name, digest in record.items() if name != DIGEST_KEY} if is_sound(record) else {}


def _unfitting(promised: Mapping[str, str], whole: Mapping[str, bytes]) -> list[str]:
    return [
        name
        for name, digest in promised.items()
        if name not in whole or hashlib.sha256(whole[name]).hexdigest() != digest
    ]
