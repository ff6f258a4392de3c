"""Walk through a segment chunk by chunk: whole frames for a reader, every record for a verification, and each loss.

A frame's record and image belong together if they name the same capture time, and are delivered only if the image has
the digest that the record states. Our writer puts both into one chunk, one right after the other; another writer may
separate them, so each waits for its partner until the next chunk has been read. One without the other is a loss.

If a chunk does not fit its CRC, the records that can still be read show which frame was damaged. The numbers and times
in MCAP's own message heads help: no digest covers them, but damage in both places is unlikely.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, takewhile
from typing import TypeVar

from flight_file.errors import Loss, LossKind
from flight_file.frame import Frame, storable
from flight_file.messages import (
    CHANNEL_TOPICS,
    FRAME_TOPIC,
    PICTURE_TOPICS,
    Image,
    MalformedMessageError,
    decode_frame,
    decode_image,
    encode_image,
)
from flight_file.records import (
    ByteSource,
    Channel,
    ChunkPlace,
    DamagedRecordError,
    Message,
    Opcode,
    parse_message,
    raw_records,
    read_chunk,
    split_chunk,
    unchecked_chunk,
)
from flight_file.segment import Segment, opened
from flight_file.session import opened_frame
from flight_file.summary import Contents
from flight_file.thresholds import MAX_UNPAIRED

UNREADABLE = (DamagedRecordError, MalformedMessageError)
_Beside = TypeVar("_Beside")
_NUMBERS = 2**32  # MCAP numbers messages by 32 bits


@dataclass(frozen=True, slots=True)
class Unpaired:
    """A frame that cannot be delivered: the reason, its chunk (offset and length, bytes), its record if known."""

    reason: str
    offset: int
    length: int
    frame: Frame | None = None


@dataclass(frozen=True, slots=True)
class _Waiting:
    item: Frame | Image
    offset: int
    length: int
    round: int


class Pairing:
    """Pairs the two messages of each frame of one file."""

    def __init__(self) -> None:
        self._numbers = count()
        self._waiting: dict[int, _Waiting] = {}  # in the order they came
        self._by_time: dict[tuple[bool, int], deque[int]] = {}  # numbers of records (True) and of images of one time
        self._round = 0

    def feed(self, item: Frame | Image, *, offset: int, length: int) -> Frame | Unpaired | None:
        """Take one message of the chunk at `offset`; return the frame if this completes one."""
        is_record = isinstance(item, Frame)
        if (not is_record, item.captured_ns) in self._by_time:
            other = self._take_first(not is_record, item.captured_ns)
            return _paired(item, other.item, offset, length)
        number = next(self._numbers)
        self._waiting[number] = _Waiting(item, offset, length, self._round)
        self._by_time.setdefault((is_record, item.captured_ns), deque()).append(number)
        return None

    def _take_first(self, is_record: bool, captured_ns: int) -> _Waiting:  # noqa: FBT001 - half of the key
        numbers = self._by_time[is_record, captured_ns]
        waiting = self._waiting.pop(numbers.popleft())
        if not numbers:
            del self._by_time[is_record, captured_ns]
        return waiting

    def end_chunk(self) -> list[Unpaired]:
        """Finish a chunk, or the file after the last; return halves that have waited a whole chunk in vain."""
        late = list(takewhile(lambda waiting: waiting.round < self._round, self._waiting.values()))
        for waiting in late:  # the oldest of all, so each is also the first of its time
            self._take_first(isinstance(waiting.item, Frame), waiting.item.captured_ns)
        self._round += 1
        return [
            Unpaired(_why(item), waiting.offset, waiting.length, item if isinstance(item, Frame) else None)
            for waiting in late
            for item in (waiting.item,)
        ]


class Records:
    """Records of frames, to find the one that an image belongs to."""

    def __init__(self, records: Iterable[Frame]) -> None:
        self._fitting: dict[tuple[int, str], Frame] = {}
        self._of_time: dict[int, Frame] = {}
        for record in records:
            self._fitting.setdefault((record.captured_ns, record.sha256), record)
            self._of_time.setdefault(record.captured_ns, record)

    def paired(self, image: Image) -> Frame | str:
        """Pair an image with the first fitting record of its time; or return why there is none."""
        record = self._fitting.get((image.captured_ns, hashlib.sha256(image.encoded).hexdigest()))
        if record is not None:
            return record.with_encoded(image.encoded)
        record = self._of_time.get(image.captured_ns)
        return _why(image) if record is None else _misfit(record)


def _misfit(record: Frame) -> str:
    return f"the picture of frame {record.sequence} does not fit its SHA-256"


def _paired(one: Frame | Image, two: Frame | Image, offset: int, length: int) -> Frame | Unpaired:
    if isinstance(one, Image) or isinstance(two, Frame):
        return _paired(two, one, offset, length)
    if hashlib.sha256(two.encoded).hexdigest() != one.sha256:
        return Unpaired(_misfit(one), offset, length, one)
    return one.with_encoded(two.encoded)


def _why(item: Frame | Image) -> str:
    if isinstance(item, Frame):
        return f"the picture of frame {item.sequence} is lost, its record is there"
    return f"the record of the picture taken at {item.captured_ns} ns is lost, so it cannot be checked"


def walk(segment: Segment) -> Iterator[tuple[ChunkPlace, Frame] | Loss]:
    """Iterate over every frame with its chunk, and every loss, in the order of the file.

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
            yield from _left(segment, pairing.end_chunk())
        yield from _left(segment, pairing.end_chunk())


def _left(segment: Segment, unpaired: Sequence[Unpaired]) -> Iterator[Loss]:
    for found in unpaired[:MAX_UNPAIRED]:
        yield _unpaired(segment, found)
    if len(unpaired) > MAX_UNPAIRED:
        more = replace(
            unpaired[MAX_UNPAIRED],
            reason=f"{len(unpaired) - MAX_UNPAIRED} more such halves of frames beside these",
        )
        yield _unpaired(segment, more)


def _unpaired(segment: Segment, found: Unpaired) -> Loss:
    return Loss(segment.path, found.offset, found.length, found.reason, LossKind.DAMAGED)


def items_of(
    segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str]
) -> Iterator[Frame | Image]:
    """Iterate over a chunk's frame records and images; `channels` (topic by id) learns the chunk's channels.

    Raises
    ------
    DamagedRecordError, MalformedMessageError
        If the chunk, or a message in it, differs from what was written.
    """
    for record in split_chunk(read_chunk(source, place, needs_crc=not segment.finished)):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        else:
            item = decoded(record, channels)
            if item is not None:
                yield item


def beside(
    segment: Segment,
    source: ByteSource,
    place: ChunkPlace,
    channels: dict[int, str],
    decoders: Mapping[str, Callable[[memoryview], _Beside]],
) -> Iterator[_Beside]:
    """Iterate over a chunk's messages other than frames, like `items_of`; `decoders` are by topic."""
    for record in split_chunk(read_chunk(source, place, needs_crc=not segment.finished)):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        elif (decode := decoders.get(channels.get(record.channel_id, ""))) is not None:
            yield decode(record.data)


def decoded(message: Message, channels: Mapping[int, str]) -> Frame | Image | None:
    """Decode a message that is half of a frame; None for another; raises MalformedMessageError."""
    topic = channels.get(message.channel_id)
    if topic in PICTURE_TOPICS:
        return decode_image(message.data, topic)
    return decode_frame(message.data) if topic == FRAME_TOPIC else None


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """A frame as it is in the file.

    Attributes
    ----------
    sequence, captured_ns
        From its record; None if it cannot be read.
    head_number
        Number in the head of its picture's message, or else its record's.
    content, stated
        The bytes of its record that the chain covers, and the stated value.
    record_misfit, picture_misfit
        What was changed in it, in words; empty if this frame by itself shows no change.
    heads_fit
        Whether the heads of its two messages agree with the record.
    """

    sequence: int | None
    captured_ns: int | None = None
    head_number: int = 0
    content: bytes = b""
    stated: str = ""
    record_misfit: str = ""
    picture_misfit: str = ""
    heads_fit: bool = True

    @property
    def misfit(self) -> str:
        """What was changed in it; empty if nothing."""
        return self.record_misfit or self.picture_misfit or ("" if self.heads_fit else "its messages' heads differ")


@dataclass(frozen=True, slots=True)
class ChunkRecords:
    """The frames of one chunk.

    Attributes
    ----------
    damage
        How the chunk was damaged; empty if it was not. If damaged, the frames are those that can still be read.
    complete
        Whether it could be read to its end.
    """

    place: ChunkPlace
    frames: tuple[FrameRecord, ...]
    damage: str = ""
    complete: bool = True


def walk_records(segment: Segment, contents: Contents) -> Iterator[ChunkRecords | Loss]:
    """Iterate over every chunk in the order of the file, and every loss in its place.

    Parameters
    ----------
    contents
        Learns what the chunks hold.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    if not segment.is_ours:
        yield from _foreign(segment)
        return
    outside = sorted((loss for loss in segment.losses if loss.length), key=lambda loss: loss.offset)
    with opened(segment.path) as source:
        for place in segment.chunks:
            while outside and outside[0].offset < place.offset:
                yield outside.pop(0)
            yield _chunk(segment, source, place, contents)
    yield from outside


def _foreign(segment: Segment) -> Iterator[ChunkRecords | Loss]:
    # Other writers may separate a frame's two halves, and have no chain.
    for found in walk(segment):
        if isinstance(found, Loss):
            yield found
        else:
            place, frame = found
            yield ChunkRecords(place, (FrameRecord(frame.sequence, frame.captured_ns),))


def _chunk(segment: Segment, source: ByteSource, place: ChunkPlace, contents: Contents) -> ChunkRecords:
    damage = ""
    try:
        records = read_chunk(source, place, needs_crc=not segment.finished)
    except DamagedRecordError as error:
        damage = str(error)
        try:
            records, _ = unchecked_chunk(source, place)
        except DamagedRecordError:
            return ChunkRecords(place, (), damage, complete=False)
    messages: list[tuple[Message, int]] = []
    complete = True
    try:
        for opcode, content, offset in raw_records(records):
            if opcode == Opcode.MESSAGE:
                messages.append((parse_message(content), offset))
            elif not damage:
                contents.define(opcode, bytes(content))
    except DamagedRecordError as error:
        damage, complete = damage or str(error), False
    if not damage:
        contents.check_indexes(source, place, messages)
    return ChunkRecords(place, tuple(_frames(messages, contents)), damage, complete)


def _frames(messages: Sequence[tuple[Message, int]], contents: Contents) -> Iterator[FrameRecord]:
    waiting: Message | None = None
    for message, _ in messages:
        topic = contents.topics.get(message.channel_id)
        if topic in PICTURE_TOPICS:
            yield _frame(waiting, message, topic)
            waiting = None
        elif topic == FRAME_TOPIC:
            if waiting is not None:
                yield _frame(waiting, None, "")
            waiting = message
    if waiting is not None:
        yield _frame(waiting, None, "")


def _frame(record: Message | None, picture: Message | None, topic: str) -> FrameRecord:
    frame = _decoded(record)
    heads = [head for head in (picture, record) if head is not None]
    content, stated = opened_frame(bytes(record.data)) if record is not None else (b"", "")
    return FrameRecord(
        sequence=frame.sequence if frame is not None else None,
        captured_ns=frame.captured_ns if frame is not None else None,
        head_number=heads[0].sequence,
        content=content,
        stated=stated,
        record_misfit=_misfit_of_record(record, frame),
        picture_misfit=_misfit_of_picture(record, picture, frame, topic),
        heads_fit=_heads_fit(heads, frame),
    )


def _decoded(record: Message | None) -> Frame | None:
    try:
        return decode_frame(record.data) if record is not None else None
    except MalformedMessageError:
        return None


def _misfit_of_record(record: Message | None, frame: Frame | None) -> str:
    if record is None:
        return "its record is gone, its picture is there"
    return "its record cannot be read" if frame is None else ""


def _misfit_of_picture(record: Message | None, picture: Message | None, frame: Frame | None, topic: str) -> str:
    if picture is None:
        return "its picture is gone, its record is there"
    return _misfit_of_content(picture, frame, topic) if record is not None and frame is not None else ""


def _misfit_of_content(picture: Message, frame: Frame, topic: str) -> str:
    try:
        image = decode_image(picture.data, topic)
    except MalformedMessageError:
        return "its picture cannot be read"
    if image.captured_ns != frame.captured_ns:
        return "its picture is dated otherwise than its record"
    if hashlib.sha256(image.encoded).hexdigest() != frame.sha256:
        return "its picture does not fit its SHA-256"
    if encode_image(frame.with_encoded(image.encoded)) != picture.data:
        return "its picture's message holds something besides the picture"
    return ""


def _heads_fit(heads: Sequence[Message], frame: Frame | None) -> bool:
    if len({(head.sequence, head.log_ns, head.publish_ns) for head in heads}) > 1:
        return False
    wanted = (frame.sequence % _NUMBERS, storable(frame.captured_ns)) if frame is not None else None
    return wanted is None or (heads[0].sequence, heads[0].publish_ns) == wanted
