"""Walk a file from record to record, without reading the chunks' contents.

Works on finished, unfinished and damaged files alike: it never uses the summary. After a record that makes no sense,
the walk continues at the next chunk whose CRC fits; the bytes between are a loss. So a damaged length cannot mislead
it: a jump either lands on a record whose lengths agree with each other, or is undone by the search for a chunk whose
CRC fits.

What our writer never writes is a loss, even if intact: a second record of a name that occurs in a segment once, a
second attachment of a name, or a chunk after the end record. Another reader might accept it.
"""

from __future__ import annotations

import re
import shlex
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

from isal.isal_zlib import crc32

from flight_file.documents import is_heif
from flight_file.errors import Loss, LossKind, NotAFlightError
from flight_file.records import (
    CHUNK_HEAD_BYTES,
    FOOTER_BYTES,
    MAGIC,
    RECORD_HEADER,
    Attachment,
    ByteSource,
    ChunkPlace,
    DamagedRecordError,
    MisplacedRecordError,
    Opcode,
    most_unpacked,
    parse_attachment,
    parse_chunk_head,
    parse_header,
    parse_message_index,
    parse_metadata,
    read_chunk,
)
from flight_file.session import ATTACHMENTS_RECORD, CHECKPOINT_RECORD, END_RECORD, SESSION_RECORD
from flight_file.thresholds import BLOCK_BYTES, MAX_RECORD_BYTES, MAX_RECORDS

_ONCE = frozenset({SESSION_RECORD, ATTACHMENTS_RECORD, END_RECORD})

# A chunk record: lengths below 2**40, a known compression; everything else about it is proved by its CRC.
_CHUNK_START = re.compile(
    rb"(?=\x06.{5}\x00{3}.{28}(?:\x00{4}|\x03\x00{3}lz4|\x04\x00{3}zstd).{5}\x00{3})",
    re.DOTALL,
)
_CHUNK_START_BYTES = RECORD_HEADER.size + CHUNK_HEAD_BYTES
# Most damage is short: a search begins with a small step, and reads on in ever larger ones.
_FIRST_REACH_BYTES = 2**12

_HEAD_BYTES = 12
_BOXES = frozenset((b"ftyp", b"moov", b"mdat", b"wide", b"skip"))
_EBML = b"\x1a\x45\xdf\xa3"


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """A metadata record `checkpoint`: where it begins and ends in the file, and its items."""

    offset: int
    end: int
    record: dict[str, str]


@dataclass(slots=True)
class FileScan:
    """The findings of a walk over one file.

    Attributes
    ----------
    finished
        Whether the file ends as MCAP requires: footer and magic.
    metadata
        The records by name, except checkpoints; the first if there are several.
    attachments
        Those whose CRC fits (or which have none, in a finished file).
    places
        Offsets and lengths of the chunks, attachments and metadata records, bytes: what an index must list.
    end_of_data
        Where the data section ends; None if it has no end.
    """

    path: Path
    size_bytes: int
    profile: str = ""
    library: str = ""
    finished: bool = False
    chunks: list[ChunkPlace] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    checkpoints: list[Checkpoint] = field(default_factory=list)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    places: dict[int, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))
    end_of_data: int | None = None
    losses: list[Loss] = field(default_factory=list)


def is_video(head: bytes) -> bool:
    """Whether a file with this beginning is an MP4 or MOV, an MKV, or an AVI."""
    if is_heif(head):
        return False
    return head[4:8] in _BOXES or head.startswith(_EBML) or (head[:4] == b"RIFF" and head[8:12] == b"AVI ")


def scan_file(path: Path, source: ByteSource) -> FileScan:
    """Walk a file.

    Raises
    ------
    NotAFlightError
        If the file is empty or does not begin as MCAP does.
    """
    if source.size == 0:
        raise NotAFlightError(path, reason="is empty; nothing was recorded")
    head = source.read_at(0, _HEAD_BYTES)
    if is_video(head):
        target = path.with_suffix(".mcap").name
        command = shlex.join(["recorder", "replay", path.name, "-o", target])
        reason = f"is a video, not a flight file; first make one from it: {command}"
        raise NotAFlightError(path, reason=reason)
    if not head.startswith(MAGIC):
        raise NotAFlightError(path, reason="is not an MCAP file; give a recording that ends in .mcap or .mcap.part")
    return _Walk(path, source).run()


class _Walk:
    """The state of a walk: its position and findings so far."""

    def __init__(self, path: Path, source: ByteSource) -> None:
        self._source = source
        self._position = len(MAGIC)
        self._at_end = False
        self._found = FileScan(path=path, size_bytes=source.size, finished=_is_finished(source))
        self._unpacked_left = most_unpacked(source.size)
        self._kept_left = MAX_RECORD_BYTES
        self._records = 0
        self._search = _ChunkSearch(source)

    def run(self) -> FileScan:
        """Walk to the end of the data."""
        while not self._at_end and self._position < self._source.size:
            if self._records > MAX_RECORDS + self._position // 2**10:  # each takes a KiB of memory
                reason = "more records than a flight of its size has"
                self._lose(self._position, self._source.size, reason, LossKind.DAMAGED)
                break
            try:
                self._step()
            except DamagedRecordError as error:
                self._go_on_behind_damage(str(error))
        return self._found

    def _step(self) -> None:
        head = self._source.read_at(self._position, RECORD_HEADER.size)
        if len(head) < RECORD_HEADER.size:
            raise DamagedRecordError("the file ends inside a record")
        opcode, length = RECORD_HEADER.unpack(head)
        take = _TAKE.get(opcode)
        if take is None:
            raise DamagedRecordError(_OUTSIDE.get(opcode, "bytes that are no record of a flight"))
        start = self._position + RECORD_HEADER.size
        if length > self._source.size - start:
            raise DamagedRecordError("the file ends inside a record")
        if length > MAX_RECORD_BYTES:
            raise DamagedRecordError(f"a record of more than {MAX_RECORD_BYTES // 2**20} MiB")
        try:
            take(self, start, length)
        except MisplacedRecordError as error:
            self._lose(self._position, start + length, str(error), LossKind.DAMAGED)
        self._records += 1
        self._found.places[opcode].append((self._position, RECORD_HEADER.size + length))
        self._position = start + length

    def _content(self, start: int, length: int) -> memoryview:
        content = self._source.read_at(start, length)
        if len(content) < length:
            raise DamagedRecordError("the file ends inside a record")
        return memoryview(content)

    def _keep(self, length: int) -> None:
        """Count what stays in memory; raises DamagedRecordError if it is more than a box attaches."""
        if length > self._kept_left:
            raise DamagedRecordError(f"more than {MAX_RECORD_BYTES // 2**20} MiB of attachments and metadata")
        self._kept_left -= length

    def take_header(self, start: int, length: int) -> None:
        if start != len(MAGIC) + RECORD_HEADER.size:
            raise MisplacedRecordError("a second header")
        self._found.profile, self._found.library = parse_header(self._content(start, length))

    def take_chunk(self, start: int, length: int) -> None:
        head = parse_chunk_head(self._content(start, min(length, CHUNK_HEAD_BYTES)), length)
        if END_RECORD in self._found.metadata:
            raise MisplacedRecordError("a chunk behind the end record")
        if head.uncompressed_bytes > self._unpacked_left:
            reason = f"a chunk of {length} bytes claims to hold {head.uncompressed_bytes}: more than a flight can"
            self._lose(start - RECORD_HEADER.size, start + length, reason, LossKind.DAMAGED)
            return
        self._unpacked_left -= head.uncompressed_bytes
        self._found.chunks.append(
            ChunkPlace(start - RECORD_HEADER.size, RECORD_HEADER.size + length, head.start_ns, {})
        )

    def take_message_index(self, start: int, length: int) -> None:
        channel_id, count = parse_message_index(self._content(start, length))
        if self._found.chunks:
            self._found.chunks[-1].messages[channel_id] = count

    def take_attachment(self, start: int, length: int) -> None:
        content = self._content(start, length)
        attachment = parse_attachment(content)
        proved = attachment.crc == crc32(content[: attachment.crc_bytes])
        if not proved and (attachment.crc or not self._found.finished):
            self._lose(
                start, start + length, f"the attachment {attachment.name!r} does not fit its CRC", LossKind.DAMAGED
            )
            return
        if attachment.name in self._found.attachments:
            raise MisplacedRecordError(f"a second attachment {attachment.name!r}")
        self._keep(length)
        self._found.attachments[attachment.name] = attachment

    def take_metadata(self, start: int, length: int) -> None:
        name, items = parse_metadata(self._content(start, length))
        if name == CHECKPOINT_RECORD:
            self._found.checkpoints.append(Checkpoint(start - RECORD_HEADER.size, start + length, items))
        elif name in _ONCE and name in self._found.metadata:
            raise MisplacedRecordError(f"a second record {name!r}")
        else:
            self._keep(length)
            self._found.metadata[name] = items

    def take_data_end(self, start: int, length: int) -> None:
        if length != _DATA_END_BYTES:
            raise DamagedRecordError("the end of the data is damaged")
        self._found.end_of_data = start - RECORD_HEADER.size
        self._at_end = True

    def _go_on_behind_damage(self, reason: str) -> None:
        found = self._search.first_from(self._position + 1)
        if found is None:
            kind = LossKind.DAMAGED if self._found.finished else LossKind.TRUNCATED
            self._lose(self._position, self._source.size, reason, kind)
            self._position = self._source.size
        else:
            self._lose(self._position, found, reason, LossKind.DAMAGED)
            self._position = found

    def _lose(self, start: int, end: int, reason: str, kind: LossKind) -> None:
        self._found.losses.append(Loss(self._found.path, start, end - start, reason, kind))


_DATA_END_BYTES = 4
_TAKE = {
    Opcode.HEADER: _Walk.take_header,
    Opcode.CHUNK: _Walk.take_chunk,
    Opcode.MESSAGE_INDEX: _Walk.take_message_index,
    Opcode.ATTACHMENT: _Walk.take_attachment,
    Opcode.METADATA: _Walk.take_metadata,
    Opcode.DATA_END: _Walk.take_data_end,
}
_OUTSIDE = dict.fromkeys(
    (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE), "a record outside of the chunks, where no CRC protects it"
)


def _is_finished(source: ByteSource) -> bool:
    tail = source.read_at(max(source.size - FOOTER_BYTES - len(MAGIC), 0), FOOTER_BYTES + len(MAGIC))
    return len(tail) == FOOTER_BYTES + len(MAGIC) and tail.endswith(MAGIC) and tail[0] == Opcode.FOOTER


class _ChunkSearch:
    """Searches for chunks after damage; gives up on a file full of bytes that only look like chunks."""

    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self._left_bytes = most_unpacked(source.size)  # limit on unpacking what turns out not to be a chunk

    def first_from(self, start: int) -> int | None:
        """Return the offset of the first chunk at or after `start` whose CRC fits; None if there is none."""
        position, reach = start, _FIRST_REACH_BYTES
        # A hole can be a thousand times larger than the disk.
        while (position := self._source.written_from(position)) < self._source.size:
            window = self._source.read_at(position, reach + _CHUNK_START_BYTES)
            for match in _CHUNK_START.finditer(window, 0):
                if match.start() < reach and self._is_chunk(position + match.start()):
                    return position + match.start()
                if self._left_bytes < 0:
                    return None
            position += reach
            reach = min(2 * reach, BLOCK_BYTES)
        return None

    def _is_chunk(self, offset: int) -> bool:
        _, length = RECORD_HEADER.unpack(self._source.read_at(offset, RECORD_HEADER.size))
        end = offset + RECORD_HEADER.size + length
        if end > self._source.size or length > MAX_RECORD_BYTES:
            return False
        try:
            start = self._source.read_at(offset + RECORD_HEADER.size, min(length, CHUNK_HEAD_BYTES))
            head = parse_chunk_head(memoryview(start), length)
            self._left_bytes -= length + head.uncompressed_bytes
            read_chunk(self._source, ChunkPlace(offset, RECORD_HEADER.size + length, 0, {}), needs_crc=True)
        except DamagedRecordError:
            return False
        self._left_bytes += length + head.uncompressed_bytes
        return True
