"""One chunk: read it, check it, take it apart."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from isal.isal_zlib import crc32

from flight_file.records import (
    RECORD_HEADER,
    Channel,
    ChunkHead,
    DamagedRecordError,
    Message,
    Opcode,
    parse_channel,
    parse_chunk_head,
    parse_message,
)

MAX_RECORD_BYTES = 2**30  # no chunk or attachment of a flight comes near; a damaged length must not fill the memory


class ByteSource(Protocol):
    """What is read from: positions are absolute, and fewer bytes than asked for means the end of the file."""

    @property
    def size(self) -> int:
        """Bytes in the file when it was opened."""
        ...

    def read_at(self, offset: int, length: int) -> bytes:
        """Up to `length` bytes from `offset`."""
        ...


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Where a chunk lies: `offset` of its record, `length` of the whole record with its opcode and length, bytes.

    `messages` counts by channel id, as far as the indexes after the chunk tell; it is empty if they do not.
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
        """Up to `length` bytes from `offset`."""
        data = os.pread(self._descriptor, length, offset)
        if len(data) == length or not data:
            return data
        return data + self.read_at(offset + len(data), length - len(data))


def read_chunk(source: ByteSource, place: ChunkPlace, *, needs_crc: bool) -> memoryview:
    """The chunk's records, uncompressed and checked.

    Parameters
    ----------
    needs_crc
        Whether a chunk without a CRC is refused. A finished file of another writer may have none; in an unfinished one,
        a CRC of zero is what a power cut leaves behind.

    Raises
    ------
    DamagedRecordError
        If a single bit is not as it was written.
    """
    record = memoryview(source.read_at(place.offset, place.length))
    if len(record) != place.length:
        raise DamagedRecordError("a chunk is cut")
    opcode, content_bytes = RECORD_HEADER.unpack_from(record)
    content = record[RECORD_HEADER.size :]
    if opcode != Opcode.CHUNK or content_bytes != len(content):
        raise DamagedRecordError("a chunk's head is damaged")
    head = parse_chunk_head(content, len(content))
    records = _uncompressed(head, content[head.data_offset :])
    if head.crc == 0 and needs_crc:
        raise DamagedRecordError("a chunk has no CRC and the file is not finished")
    if head.crc != 0 and crc32(records) != head.crc:
        raise DamagedRecordError("a chunk does not fit its CRC")
    return records


def _uncompressed(head: ChunkHead, data: memoryview) -> memoryview:
    if head.uncompressed_bytes > MAX_RECORD_BYTES:
        raise DamagedRecordError("a chunk claims to be larger than a gibibyte")
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
    # One byte more than promised is enough to see that the promise is wrong; a bomb is never unpacked.
    return memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))


def _zstd(data: memoryview, size: int) -> memoryview:
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        return memoryview(reader.read(size + 1))


_DECOMPRESS = {"": _stored, "lz4": _lz4, "zstd": _zstd}


def split_chunk(records: memoryview) -> Iterator[Channel | Message]:
    """The channels and messages of a chunk in their order; other records are passed over.

    Raises
    ------
    DamagedRecordError
        If the records do not fill the chunk.
    """
    position = 0
    while position < len(records):
        if len(records) - position < RECORD_HEADER.size:
            raise DamagedRecordError("a chunk ends inside a record")
        opcode, length = RECORD_HEADER.unpack_from(records, position)
        position += RECORD_HEADER.size
        content = records[position : position + length]
        if len(content) != length:
            raise DamagedRecordError("a chunk ends inside a record")
        position += length
        if opcode == Opcode.CHANNEL:
            yield parse_channel(content)
        elif opcode == Opcode.MESSAGE:
            yield parse_message(content)
