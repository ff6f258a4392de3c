"""A file's index and summary: its duration by three short reads, and whether its indexes match its chunks.

    ... statistics ... summary offsets, footer, magic
            ^            |      ^          |
            └────────────┘      └──────────┘

The `mcap` package reads all of a summary and trusts its lengths; a file with false ones fills the memory.

Other readers trust the indexes. Three things are checked in a finished segment: MCAP's two CRCs (of the data section,
and of the index at the end) over everything outside the chunks; that nothing is defined twice in different ways; and
that each index lists exactly what exists. A file of another writer may have fewer indexes than ours, so only its CRCs
are checked.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from isal.isal_zlib import crc32

from flight_file.errors import FindingKind
from flight_file.messages import CHANNEL_TOPICS, PICTURE_TOPICS, TOPICS
from flight_file.records import (
    FOOTER_BYTES,
    MAGIC,
    RECORD_HEADER,
    ByteSource,
    ChunkPlace,
    DamagedRecordError,
    Fields,
    FileSource,
    Message,
    Opcode,
    parse_channel,
    raw_records,
)
from flight_file.scan import scan_file
from flight_file.segment import Segment
from flight_file.thresholds import BLOCK_BYTES, MAX_SMALL_BYTES
from flight_file.untrusted import open_regular

_FOOTER_BODY = struct.Struct("<QQI")  # start of the summary, start of its offsets, CRC
_OFFSET = struct.Struct("<BQQ")  # opcode of a group of records, where it begins, its length
_STATISTICS = struct.Struct("<QHIIIIQQI")  # six counts, first and last log time, bytes of the counts by channel
_COUNT = struct.Struct("<HQ")  # channel, messages
_PICTURE_CHANNELS = frozenset(number for number, topic in CHANNEL_TOPICS.items() if topic in PICTURE_TOPICS)
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the index, start of its offsets, CRC
_FOOTER_HEAD = (Opcode.FOOTER, FOOTER_BYTES - RECORD_HEADER.size)
_DATA_END = struct.Struct("<BQI")
_DATA_END_HEAD = (Opcode.DATA_END, _DATA_END.size - RECORD_HEADER.size)
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_INDEX_ENTRY = struct.Struct("<QQ")  # log time, offset in the chunk
_INDEX_PLACE = struct.Struct("<HQ")  # channel, offset of its message index
_INDEXED: dict[int, Opcode] = {
    Opcode.CHUNK_INDEX: Opcode.CHUNK,
    Opcode.ATTACHMENT_INDEX: Opcode.ATTACHMENT,
    Opcode.METADATA_INDEX: Opcode.METADATA,
}
_OUR_TOPICS = frozenset(topic.name for topic in TOPICS)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A segment's own statistics: the time from its first to its last message, by log time, and its pictures."""

    span_ns: int
    pictures: int


def recorded(path: Path) -> Recorded:
    """Read a finished segment's statistics.

    Raises
    ------
    OSError
        It cannot be read, or is not a regular file; a link is not one.
    DamagedRecordError
        It is not finished, or its statistics are misplaced or wrong.
    """
    descriptor = open_regular(path, through_links=False)
    try:
        fields = _statistics(FileSource(descriptor))
    finally:
        os.close(descriptor)
    *_, start_ns, end_ns, counts_bytes = _STATISTICS.unpack(fields.take(_STATISTICS.size))
    counts = fields.take(counts_bytes)
    fields.expect_end()
    if counts_bytes % _COUNT.size or end_ns < start_ns:
        raise DamagedRecordError("the statistics contradict themselves")
    by_channel = dict(_COUNT.iter_unpack(counts))
    return Recorded(end_ns - start_ns, sum(by_channel.get(channel, 0) for channel in _PICTURE_CHANNELS))


def recorded_so_far(path: Path) -> Recorded:
    """Measure a file in work by the chunks in it, without reading their contents.

    Raises
    ------
    OSError
        It cannot be read, or is not a regular file; a link is not one.
    NotAFlightError
        It is not MCAP.
    """
    descriptor = open_regular(path, through_links=False)
    try:
        chunks = scan_file(path, FileSource(descriptor)).chunks
    finally:
        os.close(descriptor)
    starts_ns = [chunk.start_ns for chunk in chunks] or [0]
    pictures = sum(chunk.messages.get(channel, 0) for chunk in chunks for channel in _PICTURE_CHANNELS)
    return Recorded(max(starts_ns) - min(starts_ns), pictures)


def _statistics(source: ByteSource) -> Fields:
    footer_at = source.size - FOOTER_BYTES - len(MAGIC)
    footer = _record(source, footer_at, FOOTER_BYTES, Opcode.FOOTER)
    _, offsets_at, _ = _FOOTER_BODY.unpack(footer.take(_FOOTER_BODY.size))
    offsets = _piece(source, offsets_at, footer_at - offsets_at)
    each = RECORD_HEADER.size + _OFFSET.size
    for begin in range(RECORD_HEADER.size, len(offsets) - _OFFSET.size + 1, each):
        opcode, start, length = _OFFSET.unpack_from(offsets, begin)
        if opcode == Opcode.STATISTICS:
            return _record(source, start, length, Opcode.STATISTICS)
    raise DamagedRecordError("there are no statistics")


def _record(source: ByteSource, start: int, length: int, wanted: Opcode) -> Fields:
    """Read the one record at this place."""
    piece = Fields(memoryview(_piece(source, start, length)))
    if RECORD_HEADER.unpack(piece.take(RECORD_HEADER.size)) != (wanted, length - RECORD_HEADER.size):
        raise DamagedRecordError("a record is not where it should be")
    return Fields(piece.take(length - RECORD_HEADER.size))


def _piece(source: ByteSource, start: int, length: int) -> bytes:
    if start < 0 or not RECORD_HEADER.size <= length <= MAX_SMALL_BYTES or start + length > source.size:
        raise DamagedRecordError("a part of the summary lies where none can be")
    piece = source.read_at(start, length)
    if len(piece) < length:
        raise DamagedRecordError("the file ends inside its summary")
    return piece


class Contents:
    """The contents of a segment's chunks, collected chunk by chunk.

    Attributes
    ----------
    topics
        By channel id.
    misfit
        A definition that another reader may misunderstand; empty if there is none.
    misfit_of_index
        An index that does not list what exists; empty if all do. A truncated file may lack one.
    """

    def __init__(self) -> None:
        self.topics: dict[int, str] = dict(CHANNEL_TOPICS)
        self.misfit = ""
        self.misfit_of_index = ""
        self._messages = 0
        self._defined: dict[tuple[int, int], bytes] = {}
        self._channel_of: dict[str, int] = {}  # the first that defines one of our topics
        self._indexes: dict[int, dict[int, int]] = {}  # offset of a chunk: offsets of its message indexes by channel

    def define(self, opcode: int, content: bytes) -> None:
        """Add a schema or a channel; the first definition counts."""
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.misfit = self.misfit or "a chunk holds a record that belongs into no chunk"
            return
        number = Fields(memoryview(content)).number(_U16)
        if self._defined.setdefault((opcode, number), content) != content:
            word = Opcode(opcode).name.lower()
            self.misfit = self.misfit or f"{word} {number} is defined twice, in different ways"
        elif opcode == Opcode.CHANNEL:
            self._define_topic(number, parse_channel(memoryview(content)).topic)

    def _define_topic(self, number: int, topic: str) -> None:
        if topic in _OUR_TOPICS and self._channel_of.setdefault(topic, number) != number:
            self.misfit = self.misfit or f"two channels have the topic {topic}"
        self.topics[number] = topic

    def check_indexes(self, source: ByteSource, place: ChunkPlace, messages: Sequence[tuple[Message, int]]) -> None:
        """Compare the message indexes after a chunk with its messages, each with its offset in the chunk."""
        self._messages += len(messages)
        wanted: dict[int, list[tuple[int, int]]] = {}
        for message, offset in messages:
            wanted.setdefault(message.channel_id, []).append((message.log_ns, offset))
        found: dict[int, list[tuple[int, int]]] = {}
        places: dict[int, int] = {}
        for offset, channel, entries in _message_indexes(source, place.offset + place.length):
            found.setdefault(channel, []).extend(entries)
            places[channel] = offset
        if {channel: entries for channel, entries in found.items() if entries} != wanted:
            self._find(f"the index behind the chunk at byte {place.offset} lists other messages than the chunk holds")
        self._indexes[place.offset] = places

    def check_summary(self, segment: Segment, summary: memoryview) -> None:
        """Compare the index at the end of the file with everything before it; raises DamagedRecordError."""
        listed: dict[int, list[tuple[int, int]]] = {kind: [] for kind in _INDEXED.values()}
        for opcode, content, _ in raw_records(summary):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, bytes(content))
            elif opcode == Opcode.STATISTICS:
                if Fields(content).number(_U64) != self._messages:
                    self._find("the statistics at its end count other messages than there are")
            elif opcode in _INDEXED:
                listed[_INDEXED[opcode]].append(self._listed_place(opcode, Fields(content)))
            elif opcode != Opcode.SUMMARY_OFFSET:
                self._find("the index at its end holds a record that belongs into no index")
        for kind, places in listed.items():
            if sorted(places) != sorted(segment.places.get(kind, ())):
                self._find(f"the index at its end lists other {Opcode(kind).name.lower()} records than there are")

    def _listed_place(self, opcode: int, fields: Fields) -> tuple[int, int]:
        if opcode != Opcode.CHUNK_INDEX:
            return fields.number(_U64), fields.number(_U64)
        fields.take(2 * _U64.size)  # times
        offset, length = fields.number(_U64), fields.number(_U64)
        places = dict(_INDEX_PLACE.iter_unpack(fields.take(fields.number(_U32))))
        if places != self._indexes.get(offset, {}):
            self._find(f"the index at its end does not find the messages of the chunk at byte {offset}")
        return offset, length

    def _find(self, misfit: str) -> None:
        self.misfit_of_index = self.misfit_of_index or misfit


def unfitting_index(segment: Segment, source: ByteSource, contents: Contents) -> tuple[FindingKind, str] | None:
    """Check a finished file outside its chunks; return the first misfit, or None.

    Parameters
    ----------
    contents
        Contents of all its chunks.

    Raises
    ------
    OSError
        If the disk fails.
    """
    footer = source.size - FOOTER_BYTES - len(MAGIC)
    found = _FOOTER.unpack(source.read_at(footer, _FOOTER.size))
    index = (found[2] or footer) if found[:2] == _FOOTER_HEAD else -1
    damage = _unfitting_section(segment, source, index, found[-1])
    if damage:
        return FindingKind.DAMAGED, damage
    if segment.is_ours:
        try:
            contents.check_summary(segment, memoryview(source.read_at(index, footer - index)))
        except (DamagedRecordError, struct.error) as error:
            return FindingKind.CHANGED_SEGMENT, f"the index at its end cannot be read: {error}"
    return (FindingKind.CHANGED_SEGMENT, contents.misfit_of_index) if contents.misfit_of_index else None


def _unfitting_section(segment: Segment, source: ByteSource, index: int, index_crc: int) -> str:
    """Describe what does not fit its CRC; empty if all fits. A CRC of 0 means none."""
    footer = source.size - FOOTER_BYTES - len(MAGIC)
    end_of_data = index - _DATA_END.size
    if not len(MAGIC) <= end_of_data <= footer - _DATA_END.size:
        return "its footer does not point to the index"
    opcode, length, data_crc = _DATA_END.unpack(source.read_at(end_of_data, _DATA_END.size))
    if (opcode, length) != _DATA_END_HEAD or end_of_data != segment.end_of_data:
        return "its footer does not point to the end of its data"
    if data_crc and _crc(source, 0, end_of_data) != data_crc:
        return "bytes outside of the chunks do not fit their CRC"
    if index_crc and _crc(source, index, footer + _FOOTER.size - _U32.size) != index_crc:
        return "the index at its end does not fit its CRC"
    return ""


def _message_indexes(source: ByteSource, offset: int) -> Iterator[tuple[int, int, list[tuple[int, int]]]]:
    """Iterate over the message indexes after a chunk: offset, channel, and entries (log time and offset)."""
    while len(head := source.read_at(offset, RECORD_HEADER.size)) == RECORD_HEADER.size:
        opcode, length = RECORD_HEADER.unpack(head)
        end = offset + RECORD_HEADER.size + length
        if opcode != Opcode.MESSAGE_INDEX or end > source.size:
            return
        content = memoryview(source.read_at(offset + RECORD_HEADER.size, length))
        with suppress(DamagedRecordError, struct.error):  # one that cannot be read lists nothing
            fields = Fields(content)
            channel, entries = fields.number(_U16), fields.take(fields.number(_U32))
            yield offset, channel, list(_INDEX_ENTRY.iter_unpack(entries))
        offset = end


def _crc(source: ByteSource, start: int, end: int) -> int:
    crc = 0
    for offset in range(start, end, BLOCK_BYTES):
        crc = crc32(source.read_at(offset, min(BLOCK_BYTES, end - offset)), crc)
    return crc
