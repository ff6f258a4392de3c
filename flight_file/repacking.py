"""Pack what is whole of a damaged segment into a new file, chunk by chunk."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from mcap.writer import Writer

from flight_file import moments
from flight_file.chain import link, opened_frame
from flight_file.chunks import ByteSource, ChunkPlace, read_chunk, split_chunk
from flight_file.codec import Image, MalformedMessageError, decode_dropped
from flight_file.durable_file import DurableFile
from flight_file.frame import ClockReading, Frame
from flight_file.losses import Loss, LossKind
from flight_file.packing import packed_head, registered_topics
from flight_file.pairing import joined
from flight_file.records import Channel, DamagedRecordError, Message
from flight_file.scan import FileScan
from flight_file.segment import Segment, attachment_digests, understood
from flight_file.session import (
    END_RECORD,
    SESSION_RECORD,
    EndRecord,
    end_to_metadata,
    is_sound,
    session_to_metadata,
)
from flight_file.topics import CHANNEL_TOPICS, FRAME_TOPIC, HEALTH_TOPIC, IMAGE_TOPIC, STATUS_TOPIC
from flight_file.walk import decoded

_CUT_OFF = "recovered: the recording was cut off"
_DAMAGED = "recovered: the file was damaged; it had ended with: "


@dataclass(frozen=True, slots=True)
class Repacked:
    """What a new file has: frames, chunks, the SHA-256 of its bytes; and what of the old file it has not."""

    frames: int
    chunks: int
    sha256: str
    losses: tuple[Loss, ...]


def repack(scan: FileScan, source: ByteSource, file: DurableFile, *, at: ClockReading) -> Repacked:
    """Copy what is whole.

    Parameters
    ----------
    scan, source
        The damaged file.
    file
        The new one, empty and `digested`; it is complete afterwards, but neither synced nor closed.
    at
        The clocks now.

    Raises
    ------
    FlightNotReadableError, FlightNotWrittenError
        If a disk fails.
    """
    segment, attachments = understood(scan)
    stated = scan.metadata.get(SESSION_RECORD, {})
    session = stated if is_sound(stated) else session_to_metadata(segment.session)
    writer = packed_head(
        file,
        session=session,
        attachment_digests=attachment_digests(scan, attachments),
        attachments=attachments,
        log_ns=moments.storable(segment.session.started.realtime_ns),
    )
    return _Repacking(segment, source, writer).run(file, at)


class _Repacking:
    """The state of one repacking: what was copied so far, and where the chain stands."""

    def __init__(self, segment: Segment, source: ByteSource, writer: Writer) -> None:
        self._segment = segment
        self._source = source
        self._writer = writer
        self._channels = registered_topics(writer)
        self._topics: dict[int, str] = dict(CHANNEL_TOPICS)
        self._value = segment.start_of_chain
        self._losses = [loss for loss in segment.losses if loss.kind is not LossKind.NO_END]
        self._kept_offset = 0
        self._lost_before: list[int] = []
        self._frames = 0
        self._chunks = 0
        self._dropped = 0

    def run(self, file: DurableFile, at: ClockReading) -> Repacked:
        """Copy chunk after chunk, and close the new file."""
        for place in self._segment.chunks:
            try:
                self._copy_chunk(place)
            except DamagedRecordError as error:
                self._lose(place, str(error))
        self._writer.add_metadata(END_RECORD, end_to_metadata(self._end(at)))
        self._writer.finish()  # type: ignore[no-untyped-call]
        return Repacked(self._frames, self._chunks, file.sha256, tuple(self._losses))

    def _end(self, at: ClockReading) -> EndRecord:
        end = self._segment.end
        return EndRecord(
            reason=_DAMAGED + end.reason if end is not None else _CUT_OFF,
            frames=self._frames,
            dropped=max(self._dropped, end.dropped if end is not None else 0),
            ended=at,
            chain=self._value,
            recovered=True,
            lost_before=tuple(self._lost_before),
        )

    def _copy_chunk(self, place: ChunkPlace) -> None:
        # A chunk that breaks off is refused before any of it is copied.
        records = list(split_chunk(read_chunk(self._source, place, needs_crc=not self._segment.finished)))
        for channel in (record for record in records if isinstance(record, Channel)):
            self._topics[channel.id] = channel.topic
        messages = [record for record in records if isinstance(record, Message)]
        whole = self._whole_frames(place, messages)
        for index, message in enumerate(messages):
            topic = self._topics.get(message.channel_id, "")
            if topic not in self._channels or (topic in (FRAME_TOPIC, IMAGE_TOPIC) and index not in whole):
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
        lost_since = any(self._kept_offset <= loss.offset <= place.offset for loss in self._losses)
        if stated and stated != link(self._value, content) and lost_since:
            self._lost_before.append(frame.sequence)
        self._value = stated
        self._kept_offset = place.offset
        self._frames += 1

    def _whole_frames(self, place: ChunkPlace, messages: Sequence[Message]) -> dict[int, Frame]:
        """The frames of a chunk that are whole, by the places of their two messages in it."""
        items = {index: item for index, message in enumerate(messages) if (item := self._decoded(message)) is not None}
        images = {index: item for index, item in items.items() if isinstance(item, Image)}
        whole: dict[int, Frame] = {}
        for index, record in items.items():
            for partner, image in images.items():
                if isinstance(record, Frame) and record.captured_ns == image.captured_ns and joined(record, image):
                    whole[index] = whole[partner] = record
        parts = sum(self._topics.get(message.channel_id) in (FRAME_TOPIC, IMAGE_TOPIC) for message in messages)
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
