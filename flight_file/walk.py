"""Read a segment chunk by chunk: its frames, and what is lost of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from flight_file.chunks import ByteSource, ChunkPlace, read_chunk, split_chunk
from flight_file.codec import Image, MalformedMessageError, decode_frame, decode_image
from flight_file.frame import Frame
from flight_file.losses import Loss, LossKind
from flight_file.pairing import Pairing, Unpaired
from flight_file.records import Channel, DamagedRecordError, Message
from flight_file.segment import Segment, opened
from flight_file.topics import CHANNEL_TOPICS, FRAME_TOPIC, IMAGE_TOPIC

UNREADABLE = (DamagedRecordError, MalformedMessageError)


def walk(segment: Segment) -> Iterator[tuple[ChunkPlace, Frame] | Loss]:
    """Every frame with the chunk it came in, and every loss, in the order of the file.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    pairing = Pairing()
    channels = dict(CHANNEL_TOPICS)
    with opened(segment.path) as source:
        for place in segment.chunks:
            try:
                for item in items_of(segment, source, place, channels):
                    found = pairing.feed(item, offset=place.offset, length=place.length)
                    if isinstance(found, Frame):
                        yield place, found
                    elif found is not None:
                        yield _unpaired(segment, found)
            except UNREADABLE as error:
                yield Loss(segment.path, place.offset, place.length, str(error), LossKind.DAMAGED)
            yield from (_unpaired(segment, found) for found in pairing.end_chunk())
        yield from (_unpaired(segment, found) for found in pairing.end_file())


def _unpaired(segment: Segment, found: Unpaired) -> Loss:
    return Loss(segment.path, found.offset, found.length, found.reason, LossKind.DAMAGED)


def items_of(
    segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str]
) -> Iterator[Frame | Image]:
    """The frame records and images of one chunk; `channels` (topic by id) learns what the chunk says about channels.

    Raises
    ------
    DamagedRecordError, MalformedMessageError
        If the chunk, or a message in it, is not what was written.
    """
    for record in split_chunk(read_chunk(source, place, needs_crc=not segment.finished)):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        else:
            item = decoded(record, channels)
            if item is not None:
                yield item


def decoded(message: Message, channels: Mapping[int, str]) -> Frame | Image | None:
    """What a message says, if it is half of a frame; raises MalformedMessageError."""
    topic = channels.get(message.channel_id)
    if topic == IMAGE_TOPIC:
        return decode_image(message.data)
    return decode_frame(message.data) if topic == FRAME_TOPIC else None
