"""Walk over what proves a segment: each frame's record with its place in the chain, each picture, each loss."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from flight_file.chain import opened_frame
from flight_file.chunks import ByteSource, ChunkPlace, read_chunk, split_chunk
from flight_file.codec import MalformedMessageError
from flight_file.frame import Frame
from flight_file.losses import Loss, LossKind
from flight_file.pairing import Pairing, Unpaired
from flight_file.records import Channel, DamagedRecordError
from flight_file.segment import Segment, opened
from flight_file.topics import CHANNEL_TOPICS
from flight_file.walk import decoded


@dataclass(frozen=True, slots=True)
class Record:
    """A frame's record: what it says, its bytes as far as the chain covers them, and the value that it states."""

    frame: Frame
    content: bytes
    stated: str


def walk_records(segment: Segment) -> Iterator[Record | Unpaired | Loss]:
    """Every record in the order of the file, every frame whose two halves do not fit, every loss where it lies.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    outside = sorted((loss for loss in segment.losses if loss.length), key=lambda loss: loss.offset)
    pairing = Pairing()
    channels = dict(CHANNEL_TOPICS)
    with opened(segment.path) as source:
        for place in segment.chunks:
            while outside and outside[0].offset < place.offset:
                yield outside.pop(0)
            yield from _chunk(segment, source, place, channels, pairing)
            yield from pairing.end_chunk()
        yield from pairing.end_file()
    yield from outside


def _chunk(
    segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str], pairing: Pairing
) -> Iterator[Record | Unpaired | Loss]:
    try:
        for message in split_chunk(read_chunk(source, place, needs_crc=not segment.finished)):
            if isinstance(message, Channel):
                channels[message.id] = message.topic
                continue
            item = decoded(message, channels)
            if isinstance(item, Frame):
                yield Record(item, *opened_frame(bytes(message.data)))
            found = pairing.feed(item, offset=place.offset, length=place.length) if item is not None else None
            if isinstance(found, Unpaired):
                yield found
    except (DamagedRecordError, MalformedMessageError) as error:
        yield Loss(segment.path, place.offset, place.length, str(error), LossKind.DAMAGED)
