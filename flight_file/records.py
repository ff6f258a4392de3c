"""The MCAP records that a flight is read from, parsed without trusting a single length.

A record is: opcode u8, length u64, content; all little-endian. What is read here and how damage shows in it:

| record     | opcode | checked by                                                        |
| ---------- | ------ | ----------------------------------------------------------------- |
| Chunk      | 0x06   | its two lengths agree; CRC of the uncompressed records            |
| MsgIndex   | 0x07   | its two lengths agree; only counts are taken from it              |
| Attachment | 0x09   | its lengths agree; its own CRC                                    |
| Metadata   | 0x0C   | its lengths agree; our digest inside (see `session`)              |

Source: https://mcap.dev/spec. The `mcap` package checks no attachment CRC and stops at the first damaged chunk, hence
this module.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

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
    """Opcodes of the records that may stand in the data section of a flight, and of the footer."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    ATTACHMENT = 0x09
    METADATA = 0x0C
    DATA_END = 0x0F


class DamagedRecordError(ValueError):
    """A record that is not what was written; the reader turns it into a loss."""


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """A chunk's fixed fields. `data_offset` counts from the start of the record's content."""

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
        """A fixed number."""
        (value,) = layout.unpack(self.take(layout.size))
        return int(value)

    def take(self, length: int) -> memoryview:
        """So many bytes."""
        end = self.position + length
        if end > len(self._content):
            raise DamagedRecordError("a record is shorter than its fields")
        piece = self._content[self.position : end]
        self.position = end
        return piece

    def text(self) -> str:
        """A string with its length."""
        try:
            return str(self.take(self.number(_U32)), "utf-8")
        except UnicodeDecodeError as error:
            raise DamagedRecordError("a text in a record is not UTF-8") from error

    def expect_end(self) -> None:
        """Nothing may be left over."""
        if self.position != len(self._content):
            raise DamagedRecordError("a record is longer than its fields")


def parse_chunk_head(head: memoryview, record_bytes: int) -> ChunkHead:
    """Fixed fields of a chunk whose content has `record_bytes`; `head` is its first CHUNK_HEAD_BYTES, or all of it."""
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
    """A channel record."""
    fields = Fields(content)
    number = fields.number(_U16)
    fields.take(2)
    return Channel(id=number, topic=fields.text())


def parse_message(content: memoryview) -> Message:
    """A message record."""
    fields = Fields(content)
    channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack(fields.take(_MESSAGE.size))
    return Message(channel_id, sequence, log_ns, publish_ns, content[fields.position :])


def parse_message_index(content: memoryview) -> tuple[int, int]:
    """Channel id, and the number of its messages in the chunk before."""
    fields = Fields(content)
    channel_id = fields.number(_U16)
    entries_bytes = fields.number(_U32)
    fields.take(entries_bytes)
    fields.expect_end()
    return channel_id, entries_bytes // 16


def parse_attachment(content: memoryview) -> Attachment:
    """An attachment record."""
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
    """Name and items of a metadata record."""
    fields = Fields(content)
    name = fields.text()
    inner = Fields(fields.take(fields.number(_U32)))
    fields.expect_end()
    items = {}
    while inner.position < len(inner):
        key = inner.text()
        items[key] = inner.text()
    return name, items


def parse_header(content: memoryview) -> tuple[str, str]:
    """Profile and library."""
    fields = Fields(content)
    profile = fields.text()
    library = fields.text()
    fields.expect_end()
    return profile, library
