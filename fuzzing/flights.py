"""Flight files put together record by record, so that any field may be anything and every seal still fits.

CRCs, digests and the chain are made around what is put in; what a strategy damages afterwards is damage by intent.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from flight_file.frame import ClockReading
from flight_file.messages import TOPICS
from flight_file.records import MAGIC, RECORD_HEADER, Opcode
from flight_file.session import (
    DIGEST_KEY,
    EndRecord,
    Session,
    end_to_metadata,
    first_value,
    sealed,
    sealed_frame,
    session_from_metadata,
    session_to_metadata,
    start_of_segment,
)

START_NS = 1_525_435_200 * 10**9
NS_PER_S = 10**9
COMPRESS = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstandard.ZstdCompressor().compress}
_INDEX_OF: dict[int, Opcode] = {
    Opcode.CHUNK: Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT: Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA: Opcode.METADATA_INDEX,
}
IMAGE_CHANNEL, FRAME_CHANNEL, STATUS_CHANNEL = 1, 2, 3


def text(value: str) -> bytes:
    """A string with its length."""
    encoded = value.encode("utf-8", "surrogatepass")
    return struct.pack("<I", len(encoded)) + encoded


def record(opcode: int, content: bytes) -> bytes:
    """One record."""
    return RECORD_HEADER.pack(opcode, len(content)) + content


def message(channel: int, data: bytes, *, log_ns: int = START_NS) -> bytes:
    """One message."""
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", channel, 0, log_ns, log_ns) + data)


def topics() -> bytes:
    """All schemas and channels, as our writer registers them."""
    parts = []
    for number, topic in enumerate(TOPICS, start=1):
        schema = struct.pack("<H", number) + text(topic.schema_name) + text(topic.schema_encoding)
        parts.append(record(Opcode.SCHEMA, schema + struct.pack("<I", len(topic.schema)) + topic.schema))
        parts.append(channel(number, topic.name, topic.message_encoding, schema=number))
    return b"".join(parts)


def channel(number: int, name: str, encoding: str = "json", *, schema: int = 0) -> bytes:
    """One channel."""
    return record(Opcode.CHANNEL, struct.pack("<HH", number, schema) + text(name) + text(encoding) + bytes(4))


def chunk(records: bytes, compression: str = "", *, claimed_bytes: int | None = None) -> bytes:
    """A chunk whose CRC fits."""
    data = COMPRESS[compression](records)
    size = len(records) if claimed_bytes is None else claimed_bytes
    head = struct.pack("<QQQI", 0, 0, size, crc32(records)) + text(compression)
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(data)) + data)


def message_index(number: int, entries: Sequence[tuple[int, int]]) -> bytes:
    """What says where the chunk before has messages of a channel: of each its log time and its offset."""
    return record(
        Opcode.MESSAGE_INDEX,
        struct.pack("<HI", number, 16 * len(entries)) + b"".join(struct.pack("<QQ", *entry) for entry in entries),
    )


def attachment(name: str, content: bytes, media_type: str = "") -> bytes:
    """An attachment whose CRC fits."""
    whole = struct.pack("<QQ", 0, 0) + text(name) + text(media_type) + struct.pack("<Q", len(content)) + content
    return record(Opcode.ATTACHMENT, whole + struct.pack("<I", crc32(whole)))


def metadata(name: str, items: Mapping[str, str]) -> bytes:
    """A metadata record."""
    inner = b"".join(text(key) + text(value) for key, value in items.items())
    return record(Opcode.METADATA, text(name) + struct.pack("<I", len(inner)) + inner)


def flight(*parts: bytes) -> bytes:
    """A finished file without a summary."""
    return _finished(b"".join(parts), lambda _: b"")


def _finished(body: bytes, summary: Callable[[bytes], bytes]) -> bytes:
    data = MAGIC + record(Opcode.HEADER, text("flight") + text("fuzzing")) + body + record(Opcode.DATA_END, bytes(4))
    index = summary(data)
    footer = struct.pack("<QQI", len(data) if index else 0, 0, 0)
    return data + index + record(Opcode.FOOTER, footer) + MAGIC


def _summary(data: bytes) -> bytes:
    """The index of whole records: chunks with their message indexes, attachments and metadata."""
    listed: list[tuple[int, int, int, dict[int, int]]] = []
    at = len(MAGIC)
    while at < len(data):
        opcode, length = RECORD_HEADER.unpack_from(data, at)
        size = RECORD_HEADER.size + length
        if opcode in _INDEX_OF:
            listed.append((opcode, at, size, {}))
        elif opcode == Opcode.MESSAGE_INDEX:
            listed[-1][3][int.from_bytes(data[at + RECORD_HEADER.size :][:2], "little")] = at
        at += size
    parts = []
    for opcode, place, size, indexes in listed:
        content = struct.pack("<QQ", place, size) + bytes(32) + text("") + text("")
        if opcode == Opcode.CHUNK:
            offsets = b"".join(struct.pack("<HQ", *each) for each in indexes.items())
            content = struct.pack("<QQQQI", 0, 0, place, size, len(offsets)) + offsets + bytes(8) + text("") + bytes(16)
        parts.append(record(_INDEX_OF[opcode], content))
    return b"".join(parts)


def moment(time_ns: int) -> dict[str, int]:
    """Nanoseconds in the form of a frame's record."""
    return {"sec": time_ns // NS_PER_S, "nsec": time_ns % NS_PER_S}


def clocks(time_ns: int) -> dict[str, dict[str, int]]:
    """Both clocks."""
    return {"realtime": moment(time_ns), "monotonic": moment(time_ns - START_NS)}


def frame_document(sequence: int, picture: bytes, time_ns: int) -> dict[str, Any]:
    """A frame's record before anything in it is changed."""
    return {
        "sequence": sequence,
        "captured": moment(time_ns),
        "captured_sigma": moment(1000),
        "times": {name: clocks(time_ns) for name in ("before_request", "after_answer", "downloaded")},
        "exif": {"focal_length_mm": 4.45, "iso": 100, "datetime": "2018-05-04T12:00:00"},
        "zoom_position": 0.0,
        "width_px": 1024,
        "height_px": 768,
        "size_bytes": len(picture),
        "sha256": hashlib.sha256(picture).hexdigest(),
    }


def image(picture: bytes, seconds: int, nanos: int = 0) -> bytes:
    """An image message's data; the time may be any that protobuf can hold."""
    built = CompressedImage(data=picture, format="jpeg", frame_id="camera")
    built.timestamp.seconds, built.timestamp.nanos = seconds, nanos
    return built.SerializeToString()


@dataclass(frozen=True, slots=True)
class Shot:
    """A frame to be put in: what its record says, its picture, and what its image says of its time."""

    document: Mapping[str, Any]
    picture: bytes
    seconds: int
    nanos: int


def shot(sequence: int, picture: bytes, time_ns: int | None = None) -> Shot:
    """A frame with nothing wrong in it; one a second, if it is not said otherwise."""
    time_ns = START_NS + sequence * NS_PER_S if time_ns is None else time_ns
    return Shot(frame_document(sequence, picture, time_ns), picture, time_ns // NS_PER_S, time_ns % NS_PER_S)


def sealed_flight(
    shots: Sequence[Shot],
    attachments: Mapping[str, bytes],
    *,
    session: Mapping[str, str] | None = None,
    end: Mapping[str, str] | None = None,
    compression: str = "",
    per_chunk: int = 2,
) -> bytes:
    """A flight as our recorder would have sealed it; `session` and `end` replace items of these records."""
    items = session_to_metadata(Session("flight", started=ClockReading(START_NS, 0)))
    items = sealed({key: value for key, value in {**items, **(session or {})}.items() if key != DIGEST_KEY})
    try:
        value = first_value(session_from_metadata(items))
    except (ValueError, KeyError):
        value = ""
    items = sealed({**{key: item for key, item in items.items() if key != DIGEST_KEY}, "chain": value})
    digests = sealed({name: hashlib.sha256(content).hexdigest() for name, content in attachments.items()})
    value = start_of_segment(value, items[DIGEST_KEY], digests[DIGEST_KEY])
    chunks = [chunk(topics(), compression)]
    for first in range(0, len(shots), per_chunk):
        records, entries = b"", {FRAME_CHANNEL: list[tuple[int, int]](), IMAGE_CHANNEL: list[tuple[int, int]]()}
        for one in shots[first : first + per_chunk]:
            plain = json.dumps(one.document, separators=(",", ":"), ensure_ascii=False)
            document, value = sealed_frame(plain.encode("utf-8", "surrogatepass"), value)
            for number, data in (
                (FRAME_CHANNEL, document),
                (IMAGE_CHANNEL, image(one.picture, one.seconds, one.nanos)),
            ):
                entries[number].append((START_NS, len(records)))
                records += message(number, data)
        chunks.append(chunk(records, compression) + b"".join(message_index(*each) for each in entries.items()))
    ended = end_to_metadata(EndRecord("stopped", len(shots), 0, ClockReading(START_NS, 0), value))
    ended = sealed({key: item for key, item in {**ended, **(end or {})}.items() if key != DIGEST_KEY})
    carried = [attachment(name, content) for name, content in attachments.items()]
    parts = [metadata("session", items), metadata("attachments", digests), *carried, *chunks, metadata("end", ended)]
    return _finished(b"".join(parts), _summary)
