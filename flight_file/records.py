"""The MCAP records and chunks of a flight, parsed without trusting any length.

A record is: opcode u8, length u64, content; all little-endian. What is read here and how damage is detected:

| record     | opcode | checked by                                                        |
| ---------- | ------ | ----------------------------------------------------------------- |
| Chunk      | 0x06   | its two lengths agree; CRC of the uncompressed records            |
| MsgIndex   | 0x07   | its two lengths agree; only its counts are used                   |
| Attachment | 0x09   | its lengths agree; its own CRC                                    |
| Statistics | 0x0B   | its lengths agree; only plausible values are used                   |
| Metadata   | 0x0C   | its lengths agree; our digest inside (see `session`)              |

Source: https://mcap.dev/spec. The `mcap` package checks no attachment CRC and stops at the first damaged chunk, hence
this module.
"""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from isal.isal_zlib import crc32

from flight_file.thresholds import FREE_GROWTH_BYTES, GROWTH, MAX_CHUNK_BYTES, MAX_RECORDS

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = struct.Struct("<BQ")
CHUNK_FIXED = struct.Struct("<QQQII")  # start time, end time, uncompressed size, CRC, length of the compression's name
CHUNK_HEAD_BYTES = CHUNK_FIXED.size + 4 + 8  # with the longest name, and the length of the data
COMPRESSIONS = ("", "lz4", "zstd")
FOOTER_BYTES = RECORD_HEADER.size + 20
_MESSAGE = struct.Struct("<HIQQ")
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")


class Opcode(IntEnum):
    """Opcodes of the records of a flight."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class DamagedRecordError(ValueError):
    """A record differs from what was written; the reader turns it into a loss."""


class MisplacedRecordError(ValueError):
    """A record is whole but misplaced; the reader turns it into a loss."""


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """The fixed fields of a chunk. `data_offset` counts from the start of the record's content."""

    start_ns: int
    end_ns: int
    uncompressed_bytes: int
    crc: int
    compression: str
    data_offset: int
    data_bytes: int


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel record."""

    id: int
    topic: str


@dataclass(frozen=True, slots=True)
class Message:
    """A message record; `data` looks into the chunk it came in."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: memoryview


@dataclass(frozen=True, slots=True)
class Attachment:
    """An attachment record. `crc` is 0 where the writer gave none, `crc_bytes` is how much of the content it covers."""

    name: str
    data: bytes
    crc: int
    crc_bytes: int


class Fields:
    """Reads the fields of one record, one after another; raises DamagedRecordError where the record ends too early."""

    def __init__(self, content: memoryview) -> None:
        self._content = content
        self.position = 0

    def __len__(self) -> int:
        return len(self._content)

    def number(self, layout: struct.Struct) -> int:
        """Read a number."""
        (value,) = layout.unpack(self.take(layout.size))
        return int(value)

    def take(self, length: int) -> memoryview:
        """Read this many bytes."""
        end = self.position + length
        if end > len(self._content):
            raise DamagedRecordError("a record is shorter than its fields")
        piece = self._content[self.position : end]
        self.position = end
        return piece

    def text(self) -> str:
        """Read a string that begins with its length."""
        try:
            return str(self.take(self.number(_U32)), "utf-8")
        except UnicodeDecodeError as error:
            raise DamagedRecordError("a text in a record is not UTF-8") from error

    def expect_end(self) -> None:
        """Raise DamagedRecordError if anything is left over."""
        if self.position != len(self._content):
            raise DamagedRecordError("a record is longer than its fields")


def parse_chunk_head(head: memoryview, record_bytes: int) -> ChunkHead:
    """Parse the head of a chunk record of `record_bytes`, from its first CHUNK_HEAD_BYTES or all of it."""
    fields = Fields(head)
    start_ns, end_ns, uncompressed, crc, name_bytes = CHUNK_FIXED.unpack(fields.take(CHUNK_FIXED.size))
    if name_bytes > max(map(len, COMPRESSIONS)):
        raise DamagedRecordError("a chunk's compression has no known name")
    compression = bytes(fields.take(name_bytes)).decode("ascii", "replace")
    data_bytes = fields.number(_U64)
    if compression not in COMPRESSIONS or fields.position + data_bytes != record_bytes:
        raise DamagedRecordError("a chunk's head is damaged")
    if not compression and uncompressed != data_bytes:
        raise DamagedRecordError("a chunk's sizes differ")
    return ChunkHead(start_ns, end_ns, uncompressed, crc, compression, fields.position, data_bytes)


def parse_channel(content: memoryview) -> Channel:
    """Parse a channel record."""
    fields = Fields(content)
    number = fields.number(_U16)
    fields.take(2)
    return Channel(id=number, topic=fields.text())


def parse_message(content: memoryview) -> Message:
    """Parse a message record."""
    fields = Fields(content)
    channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack(fields.take(_MESSAGE.size))
    return Message(channel_id, sequence, log_ns, publish_ns, content[fields.position :])


def parse_message_index(content: memoryview) -> tuple[int, int]:
    """Parse a message index: channel id, and the number of its messages in the chunk before."""
    fields = Fields(content)
    channel_id = fields.number(_U16)
    entries_bytes = fields.number(_U32)
    fields.take(entries_bytes)
    fields.expect_end()
    return channel_id, entries_bytes // 16


def parse_attachment(content: memoryview) -> Attachment:
    """Parse an attachment record."""
    fields = Fields(content)
    fields.take(16)  # two times
    name = fields.text()
    fields.text()  # media type
    data = bytes(fields.take(fields.number(_U64)))
    crc_bytes = fields.position
    crc = fields.number(_U32)
    fields.expect_end()
    return Attachment(name=name, data=data, crc=crc, crc_bytes=crc_bytes)


def parse_metadata(content: memoryview) -> tuple[str, dict[str, str]]:
    """Parse a metadata record: its name and items."""
    fields = Fields(content)
    name = fields.text()
    inner = Fields(fields.take(fields.number(_U32)))
    fields.expect_end()
    items = {}
    while inner.position < len(inner):
        key = inner.text()
        if key in items:
            raise DamagedRecordError("a metadata record has an item twice")
        items[key] = inner.text()
    return name, items


def parse_header(content: memoryview) -> tuple[str, str]:
    """Parse the header: profile and library."""
    fields = Fields(content)
    profile = fields.text()
    library = fields.text()
    fields.expect_end()
    return profile, library


def most_unpacked(file_bytes: int) -> int:
    """Limit the uncompressed size of all chunks of a file together, bytes."""
    return FREE_GROWTH_BYTES + round(GROWTH * file_bytes)


class ByteSource(Protocol):
    """A source of bytes at absolute offsets; returning fewer bytes than asked for means the end of the file."""

    @property
    def size(self) -> int:
        """Bytes in the file when it was opened."""
        ...

    def read_at(self, offset: int, length: int) -> bytes:
        """Read up to `length` bytes from `offset`."""
        ...

    def written_from(self, offset: int) -> int:
        """Return where the next bytes are, at `offset` or behind a hole, in which nothing was ever written."""
        ...


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Position of a chunk: `offset` of its record, `length` of the whole record with its opcode and length, bytes.

    `messages` has counts by channel id from the indexes after the chunk; empty without them.
    """

    offset: int
    length: int
    start_ns: int
    messages: dict[int, int]


class FileSource:
    """A `ByteSource` on an open file descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.size = os.fstat(descriptor).st_size

    def read_at(self, offset: int, length: int) -> bytes:
        """Read up to `length` bytes from `offset`."""
        data = os.pread(self._descriptor, length, offset)
        if len(data) == length or not data:
            return data
        return data + self.read_at(offset + len(data), length - len(data))

    def written_from(self, offset: int) -> int:
        """Return where the next bytes are; where the file system knows no holes, that is `offset`."""
        try:
            return os.lseek(self._descriptor, offset, os.SEEK_DATA)
        except OSError as error:
            return self.size if error.errno == errno.ENXIO else offset


@dataclass(frozen=True, slots=True)
class Beginning:
    """A `ByteSource` that ends early: the first `size` bytes of another."""

    source: ByteSource
    size: int

    def read_at(self, offset: int, length: int) -> bytes:
        """Read up to `length` bytes from `offset`."""
        return self.source.read_at(offset, max(0, min(length, self.size - offset)))

    def written_from(self, offset: int) -> int:
        """Return where the next bytes are."""
        return self.source.written_from(offset)


def read_chunk(source: ByteSource, place: ChunkPlace, *, needs_crc: bool) -> memoryview:
    """Read a chunk's records, uncompressed and checked.

    Parameters
    ----------
    needs_crc
        Whether a chunk without a CRC is refused. A finished file of another writer may have none; in an unfinished one,
        a CRC of zero is left by a power cut.

    Raises
    ------
    DamagedRecordError
        If any bit differs from what was written.
    """
    records, crc = unchecked_chunk(source, place)
    if crc == 0 and needs_crc:
        raise DamagedRecordError("a chunk has no CRC and the file is not finished")
    if crc != 0 and crc32(records) != crc:
        raise DamagedRecordError("a chunk does not fit its CRC")
    return records


def unchecked_chunk(source: ByteSource, place: ChunkPlace) -> tuple[memoryview, int]:
    """Read a chunk's records, uncompressed, and its stated CRC; 0 for none.

    Raises
    ------
    DamagedRecordError
        If they cannot be unpacked.
    """
    record = memoryview(source.read_at(place.offset, place.length))
    if len(record) != place.length:
        raise DamagedRecordError("a chunk is cut")
    opcode, content_bytes = RECORD_HEADER.unpack_from(record)
    content = record[RECORD_HEADER.size :]
    if opcode != Opcode.CHUNK or content_bytes != len(content):
        raise DamagedRecordError("a chunk's head is damaged")
    head = parse_chunk_head(content, len(content))
    return _uncompressed(head, content[head.data_offset :]), head.crc


def _uncompressed(head: ChunkHead, data: memoryview) -> memoryview:
    if head.uncompressed_bytes > MAX_CHUNK_BYTES:
        raise DamagedRecordError(f"a chunk claims to hold more than {MAX_CHUNK_BYTES >> 20} MiB")
    try:
        plain = _DECOMPRESS[head.compression](data, head.uncompressed_bytes)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError) as error:
        raise DamagedRecordError("a chunk cannot be decompressed") from error
    if len(plain) != head.uncompressed_bytes:
        raise DamagedRecordError("a chunk does not have the size it claims")
    return plain


def _stored(data: memoryview, _size: int) -> memoryview:
    return data


def _lz4(data: memoryview, size: int) -> memoryview:
    # One byte more than stated shows that the stated size is wrong; a bomb is never unpacked.
    return memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))


def _zstd(data: memoryview, size: int) -> memoryview:
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        return memoryview(reader.read(size + 1))


_DECOMPRESS = {"": _stored, "lz4": _lz4, "zstd": _zstd}


def split_chunk(records: memoryview) -> Iterator[Channel | Message]:
    """Iterate over the channels and messages of a chunk; other records are skipped.

    Raises
    ------
    DamagedRecordError
        If the records do not fill the chunk, or are more than a recorder or a converter writes.
    """
    for number, (opcode, content, _) in enumerate(raw_records(records)):
        if number >= MAX_RECORDS:
            raise DamagedRecordError(f"a chunk holds more than {MAX_RECORDS} records")
        if opcode == Opcode.CHANNEL:
            yield parse_channel(content)
        elif opcode == Opcode.MESSAGE:
            yield parse_message(content)


def raw_records(records: memoryview) -> Iterator[tuple[int, memoryview, int]]:
    """Iterate over opcode, content and start of each record in these bytes.

    Raises
    ------
    DamagedRecordError
        If the records do not fill the bytes.
    """
    position = 0
    while position < len(records):
        if len(records) - position < RECORD_HEADER.size:
            raise DamagedRecordError("a chunk ends inside a record")
        opcode, length = RECORD_HEADER.unpack_from(records, position)
        start = position + RECORD_HEADER.size
        content = records[start : start + length]
        if len(content) != length:
            raise DamagedRecordError("a chunk ends inside a record")
        yield opcode, content, position
        position = start + length
