"""Recover a segment after a power cut or from a bad disk.

It is read chunk by chunk, with one in memory: from a chunk that fits its CRC, every frame whose picture fits its
SHA-256 is kept, byte for byte and with its times. The result is a normal finished segment; only its `end` record says
that it was recovered, and where something is missing.

| what there is                     | what becomes of it                                                        |
| --------------------------------- | ------------------------------------------------------------------------- |
| `NAME.mcap.part`, whole           | renamed to `NAME.mcap`: only that had been left to do                     |
| `NAME.mcap.part`, cut or damaged  | `NAME.mcap`; the `.part` is removed once the new file is synced, read back |
| `NAME.mcap.part`, somebody's work | left alone                                                                |
| `NAME.mcap`, cut or damaged       | `NAME.recovered.mcap`; the damaged file is kept                           |
| `NAME.mcap`, whole                | left alone                                                                |

A key signs only what the file itself proves to be that key's work, and nothing added later:

| what the file has of the key                                | what is signed                                 |
| ----------------------------------------------------------- | ---------------------------------------------- |
| a genuine signature over every byte                         | all of it; if it is whole, it is signed already |
| a genuine checkpoint, and the session that its name claims  | what stands before the last such checkpoint    |
| neither                                                     | nothing: it is recovered unsigned, and says so |

Whole frames after the last checkpoint go into a file of their own, `NAME.mcap.unproven`, which says so too: they were
written at the moment of a power cut, or added by somebody.

An interrupted recovery can be repeated: the new file is first written as `NAME.mcap.recovering`. Whatever else has one
of these names stays as it is, and the next free name is taken.
"""

from __future__ import annotations

import hashlib
import os
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from itertools import chain, count, zip_longest
from pathlib import Path

from mcap.writer import Writer

from flight_file.errors import FlightFileError, FlightNotWrittenError, Loss, LossKind, NothingToRecoverError
from flight_file.files import DurableFile, claimed, free_aside, rename_durably, sync_directory
from flight_file.frame import ClockReading, Frame, storable
from flight_file.messages import (
    CHANNEL_TOPICS,
    FRAME_TOPIC,
    HEALTH_TOPIC,
    PICTURE_TOPICS,
    STATUS_TOPIC,
    Image,
    MalformedMessageError,
    decode_dropped,
)
from flight_file.records import (
    Beginning,
    ByteSource,
    Channel,
    ChunkPlace,
    DamagedRecordError,
    Message,
    read_chunk,
    split_chunk,
)
from flight_file.scan import FileScan, scan_file
from flight_file.segment import Segment, attachment_digests, open_segment, opened, segment_of
from flight_file.session import (
    END_RECORD,
    PART_SUFFIX,
    RECOVERING_SUFFIX,
    SESSION_RECORD,
    EndRecord,
    claimed_place,
    end_to_metadata,
    is_sound,
    link,
    opened_frame,
    session_to_metadata,
    unproven_names,
)
from flight_file.signature import Signer, signature_path, write_signature
from flight_file.verification import Proof, prove, prove_file
from flight_file.walk import decoded, walk
from flight_file.writer import packed_head, register_late, registered_topics

_OF_FRAMES = PICTURE_TOPICS | {FRAME_TOPIC}
_CUT_OFF = "recovered: the recording was cut off"
_DAMAGED = "recovered: the file was damaged; it had ended with: "
_NOTHING = "nothing that was recorded is left in it; delete it"
_NOT_SIGNED = "; it is not signed: nothing in the file proves that this key recorded it"
_NOT_PROVEN = "; it is not signed: it stood behind the last checkpoint, where nothing proves it"


@dataclass(frozen=True, slots=True)
class Repacked:
    """The new file's frames, chunks and SHA-256, and what is lost of the old file."""

    frames: int
    chunks: int
    sha256: str
    losses: tuple[Loss, ...]


def repack(
    scan: FileScan, source: ByteSource, file: DurableFile, *, at: ClockReading, remark: str = "", from_bytes: int = 0
) -> Repacked:
    """Copy the undamaged parts of a damaged file.

    Parameters
    ----------
    scan, source
        The damaged file.
    file
        The new one, empty and `digested`; it is complete afterwards, but neither synced nor closed.
    at
        The clocks now.
    remark
        Addition to the end record's reason, such as `; it is not signed`.
    from_bytes
        Where in the damaged file to begin; what precedes the chunks is always copied.

    Raises
    ------
    FlightNotReadableError, FlightNotWrittenError
        If a disk fails.
    """
    segment, attachments = segment_of(scan)
    stated = scan.metadata.get(SESSION_RECORD, {})
    session = stated if is_sound(stated) else session_to_metadata(segment.session)
    writer = packed_head(
        file,
        session=session,
        attachment_digests=attachment_digests(scan, attachments),
        attachments=attachments,
        log_ns=storable(segment.session.started.realtime_ns),
    )
    return _Repacking(segment, source, writer, from_bytes).run(file, at, remark)


class _Repacking:
    """The state of one repacking: what was copied so far, and the value of the chain."""

    def __init__(self, segment: Segment, source: ByteSource, writer: Writer, from_bytes: int) -> None:
        self._segment = segment
        self._places = [place for place in segment.chunks if place.offset >= from_bytes]
        self._source = source
        self._writer = writer
        self._channels = registered_topics(writer)
        self._topics: dict[int, str] = dict(CHANNEL_TOPICS)
        self._value = segment.start_of_chain
        self._losses = [loss for loss in segment.losses if loss.kind is not LossKind.NO_END]
        self._lost_offsets = sorted(loss.offset for loss in self._losses)
        self._kept_offset = 0
        self._lost_before: list[int] = []
        self._frames = 0
        self._chunks = 0
        self._dropped = 0

    def run(self, file: DurableFile, at: ClockReading, remark: str) -> Repacked:
        """Copy chunk after chunk, and close the new file."""
        for place in self._places:
            try:
                self._copy_chunk(place)
            except DamagedRecordError as error:
                self._lose(place, str(error))
        self._writer.add_metadata(END_RECORD, end_to_metadata(self._end(at, remark)))
        self._writer.finish()  # type: ignore[no-untyped-call]
        return Repacked(self._frames, self._chunks, file.sha256, tuple(self._losses))

    def _end(self, at: ClockReading, remark: str) -> EndRecord:
        end = self._segment.end
        return EndRecord(
            reason=(_DAMAGED + end.reason if end is not None else _CUT_OFF) + remark,
            frames=self._frames,
            dropped=max(self._dropped, end.dropped if end is not None else 0),
            ended=at,
            chain=self._value,
            recovered=True,
            lost_before=tuple(self._lost_before),
        )

    def _copy_chunk(self, place: ChunkPlace) -> None:
        # A truncated chunk is refused before any of it is copied.
        records = list(split_chunk(read_chunk(self._source, place, needs_crc=not self._segment.finished)))
        for channel in (record for record in records if isinstance(record, Channel)):
            self._topics[channel.id] = channel.topic
        messages = [record for record in records if isinstance(record, Message)]
        whole = self._whole_frames(place, messages)
        for index, message in enumerate(messages):
            topic = self._topics.get(message.channel_id, "")
            register_late(self._writer, self._channels, topic)
            if topic not in self._channels or (topic in _OF_FRAMES and index not in whole):
                continue
            if topic == FRAME_TOPIC:
                self._follow_chain(whole[index], message, place)
            elif topic in (STATUS_TOPIC, HEALTH_TOPIC):
                with suppress(MalformedMessageError):
                    self._dropped = max(self._dropped, decode_dropped(message.data))
            self._copy(self._channels[topic], message)
        self._chunks += 1
        self._writer.flush()  # type: ignore[no-untyped-call]

    def _copy(self, channel: int, message: Message) -> None:
        self._writer.add_message(
            channel,
            log_time=message.log_ns,
            data=bytes(message.data),
            publish_time=message.publish_ns,
            sequence=message.sequence,
        )

    def _follow_chain(self, frame: Frame, message: Message, place: ChunkPlace) -> None:
        content, stated = opened_frame(bytes(message.data))
        nearest = bisect_left(self._lost_offsets, self._kept_offset)
        lost_since = nearest < len(self._lost_offsets) and self._lost_offsets[nearest] <= place.offset
        if stated and stated != link(self._value, content) and lost_since:
            self._lost_before.append(frame.sequence)
        self._value = stated
        self._kept_offset = place.offset
        self._frames += 1

    def _whole_frames(self, place: ChunkPlace, messages: Sequence[Message]) -> dict[int, Frame]:
        """Find a chunk's whole frames, by the positions of their two messages in it."""
        items = {index: item for index, message in enumerate(messages) if (item := self._decoded(message)) is not None}
        images: dict[tuple[int, str], deque[int]] = {}
        for index, item in items.items():
            if isinstance(item, Image):
                key = item.captured_ns, hashlib.sha256(item.encoded).hexdigest()
                images.setdefault(key, deque()).append(index)
        whole: dict[int, Frame] = {}
        for index, record in items.items():
            if isinstance(record, Frame) and (partners := images.get((record.captured_ns, record.sha256))):
                whole[index] = whole[partners.popleft()] = record
        parts = sum(self._topics.get(message.channel_id) in _OF_FRAMES for message in messages)
        if parts > len(whole):
            self._lose(place, f"{(parts - len(whole) + 1) // 2} frame(s) of a chunk are not whole")
        return whole

    def _decoded(self, message: Message) -> Frame | Image | None:
        try:
            return decoded(message, self._topics)
        except MalformedMessageError:
            return None

    def _lose(self, place: ChunkPlace, reason: str) -> None:
        last = not self._segment.finished and place == self._segment.chunks[-1]
        kind = LossKind.TRUNCATED if last else LossKind.DAMAGED
        self._losses.append(Loss(self._segment.path, place.offset, place.length, reason, kind))
        insort(self._lost_offsets, place.offset)


class Outcome(Enum):
    """The outcome of a recovery."""

    RECOVERED = "recovered"
    FINISHED = "finished"
    """It was whole and only had to be given its final name."""
    NOTHING_TO_DO = "nothing to do"
    IN_WORK = "in work"
    """Somebody writes it at this moment: left alone."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """The result of recovering one file.

    Attributes
    ----------
    source
        The file that was given.
    path
        Where its flight is now.
    frames
        Frames in it; not counted if nothing was done.
    losses
        What could not be recovered; a missing end record does not count.
    signed
        Whether it now has a signature made with the key.
    unproven, unproven_frames
        File and number of unproven frames; None and 0 if there are none, or no key.
    """

    source: Path
    path: Path
    outcome: Outcome
    frames: int = 0
    losses: tuple[Loss, ...] = ()
    signed: bool = False
    unproven: Path | None = None
    unproven_frames: int = 0


def recover_segment(path: Path, *, at: ClockReading, signer: Signer | None = None) -> Recovery:
    """Recover one file.

    Parameters
    ----------
    at
        The clocks now; goes into the `end` record.
    signer
        Signs what it provably wrote; None for no signature.

    Raises
    ------
    FlightNotReadableError, NotAFlightError
        The file cannot be read, or is not MCAP.
    NothingToRecoverError
        Nothing that was recorded is left in it.
    FlightNotWrittenError
        There is no room for the new file, or it may not be written. The given file is unchanged.
    """
    if not path.name.endswith(PART_SUFFIX):
        return _Recovery(path, at, signer).of_finished_file()
    with claimed(path) as ours:
        if not ours:
            return Recovery(path, path, Outcome.IN_WORK)
        return _Recovery(path, at, signer).of_file_in_work()


class _Recovery:
    """One recovery: the file's contents, how much of it is proven, and who signs."""

    def __init__(self, path: Path, at: ClockReading, signer: Signer | None) -> None:
        self._path = path
        self._final = path.with_name(path.name.removesuffix(PART_SUFFIX))
        self._at = at
        self._signer = signer
        with opened(path) as source:
            self._scan: FileScan = scan_file(path, source)
            self._segment: Segment = segment_of(self._scan)[0]
            self._proof = self._proven(source)

    def _proven(self, source: ByteSource) -> Proof:
        claimed, session = claimed_place(self._path), self._segment.session
        if self._signer is None or claimed not in (None, (session.recording, session.segment)):
            return Proof()
        return prove_file(self._path, source, self._scan.checkpoints, self._signer.public_key)

    def of_file_in_work(self) -> Recovery:
        """Give it its final name, whole or recovered."""
        signed = self._proof.signed_by is not None
        if not os.path.lexists(self._final) and (signed or not self._proof.proven_bytes) and _is_whole(self._segment):
            rename_durably(self._path, self._final)
            return Recovery(self._path, self._final, Outcome.FINISHED, _count_frames(self._final), signed=signed)
        recovery = self._put_together(self._final)
        _remove(self._path)
        return recovery

    def of_finished_file(self) -> Recovery:
        """Copy the undamaged parts into a new file."""
        if _is_whole(self._segment):
            return Recovery(self._path, self._path, Outcome.NOTHING_TO_DO)
        return self._put_together(_recovered_name(self._path, 1))

    def _put_together(self, wanted: Path) -> Recovery:
        if not self._segment.chunks:
            raise NothingToRecoverError(self._path, reason=_NOTHING)
        proven_bytes = self._proof.proven_bytes
        if not proven_bytes:
            everything = _Extent(0, self._scan.size_bytes, "" if self._signer is None else _NOT_SIGNED)
            target, repacked = self._copied(everything, _names(wanted), signer=None)
            return Recovery(self._path, target, Outcome.RECOVERED, repacked.frames, repacked.losses)
        target, repacked = self._copied(_Extent(0, proven_bytes), _names(wanted), signer=self._signer)
        recovery = Recovery(self._path, target, Outcome.RECOVERED, repacked.frames, repacked.losses, signed=True)
        return self._with_unproven(recovery, proven_bytes)

    def _with_unproven(self, recovery: Recovery, proven_bytes: int) -> Recovery:
        """Copy the frames after the proven bytes into a file of their own."""
        behind = tuple(place for place in self._segment.chunks if place.offset >= proven_bytes)
        lost = (loss for loss in self._segment.losses if loss.kind is not LossKind.NO_END)
        outside = tuple(loss for loss in lost if loss.offset >= proven_bytes)
        found = list(walk(replace(self._segment, chunks=behind)))
        losses = (*recovery.losses, *outside, *(loss for loss in found if isinstance(loss, Loss)))
        frames = sum(not isinstance(loss, Loss) for loss in found)
        if not frames:
            return replace(recovery, losses=losses)
        extent = _Extent(proven_bytes, self._scan.size_bytes, _NOT_PROVEN)
        target, _ = self._copied(extent, unproven_names(recovery.path), signer=None)
        return replace(recovery, losses=losses, unproven=target, unproven_frames=frames)

    def _copied(self, extent: _Extent, names: Iterator[Path], *, signer: Signer | None) -> tuple[Path, Repacked]:
        """Copy a part of the file under the first name that is free or already contains just that."""
        wanted = next(names)
        aside = free_aside(wanted, RECOVERING_SUFFIX)
        file = DurableFile(aside, digested=True)  # locked until it has its name: another recorder removes what is not
        try:
            repacked = self._repack_into(file, extent)
            # A file that already contains these frames is left from an interrupted recovery.
            free = (name for name in chain([wanted], names) if name != self._path)
            target = next(name for name in free if _is_free(name, signer) or _is_done(name, aside, signer))
            if not os.path.lexists(target):
                if signer is not None:
                    write_signature(target, repacked.sha256, signer)
                rename_durably(aside, target)
        finally:
            file.close()
            with suppress(OSError):
                aside.unlink(missing_ok=True)
        return target, repacked

    def _repack_into(self, file: DurableFile, extent: _Extent) -> Repacked:
        with opened(self._path) as whole:
            source = Beginning(whole, extent.end)
            scan = scan_file(self._path, source)
            repacked = repack(scan, source, file, at=self._at, remark=extent.remark, from_bytes=extent.start)
        file.sync()
        if not repacked.chunks:
            raise NothingToRecoverError(self._path, reason=_NOTHING)
        _inherit_owner(file.path, self._path)
        if _count_frames(file.path) != repacked.frames:
            raise FlightNotWrittenError(file.path, reason="does not read back as it was written; check the disk")
        return repacked


@dataclass(frozen=True, slots=True)
class _Extent:
    """The bytes of the file to copy, and what the copy's end record says of it."""

    start: int
    end: int
    remark: str = ""


def _is_whole(segment: Segment) -> bool:
    return segment.finished and not segment.losses and not any(isinstance(found, Loss) for found in walk(segment))


def _names(wanted: Path) -> Iterator[Path]:
    yield wanted
    yield from (_recovered_name(wanted, number) for number in count(1))


def _recovered_name(path: Path, number: int) -> Path:
    if ".recovered" in path.suffixes:
        path = path.with_name(path.name[: path.name.index(".recovered")] + ".mcap")
    ending = ".recovered.mcap" if number == 1 else f".recovered-{number}.mcap"
    return path.with_name(path.name.removesuffix(".mcap") + ending)


def _frames(path: Path) -> Iterator[Frame]:
    segment, _ = open_segment(path)
    for found in walk(segment):
        if not isinstance(found, Loss):
            yield found[1]


def _count_frames(path: Path) -> int:
    return sum(1 for _ in _frames(path))


def _is_free(name: Path, signer: Signer | None) -> bool:
    """Whether nothing has this name, nor that of its signature, except what an interrupted recovery left there."""
    signature = signature_path(name)
    is_ours = signer is not None and signature.is_file() and not signature.is_symlink()
    return not os.path.lexists(name) and (is_ours or not os.path.lexists(signature))


def _is_done(name: Path, aside: Path, signer: Signer | None) -> bool:
    """Whether an interrupted recovery made this file of the same frames; anything else may have the name."""
    if name.is_symlink():
        return False
    try:
        if signer is not None and prove(open_segment(name)[0], signer.public_key).signed_by is None:
            return False
        return all(left == right for left, right in zip_longest(_frames(name), _frames(aside)))
    except FlightFileError:
        return False


def _inherit_owner(path: Path, from_path: Path) -> None:
    # An operator may recover as root what the recorder is to manage afterwards.
    with suppress(PermissionError):
        owner = from_path.stat()
        os.chown(path, owner.st_uid, owner.st_gid)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        reason = f"cannot be removed ({error.strerror}); check who may write in its directory"
        raise FlightNotWrittenError(path, reason=reason) from error
    sync_directory(path.parent)
