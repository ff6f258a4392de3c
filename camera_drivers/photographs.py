"""Format (by the first bytes), size and EXIF of a photograph's file, without decoding it.

| format | begins with                | EXIF stands in                        |
| ------ | -------------------------- | ------------------------------------- |
| JPEG   | FF D8                      | an APP1 segment                       |
| PNG    | 89 `PNG` 0D 0A 1A 0A       | the chunk `eXIf`, without its prefix  |
| WebP   | `RIFF`, length, `WEBP`     | the chunk `EXIF`, with it or without  |
| HEIF   | a box `ftyp` of such a kind | - not stored                         |

The file's name is ignored: a JPEG called .png is a JPEG. Sources: PNG (third edition) 5.3, 11.3.4.6; WebP
container specification (RFC 9649); ISO/IEC 23008-12.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from camera_drivers.jpeg import EXIF_PREFIX, JpegFacts, jpeg_facts
from flight_file.documents import PNG_START, WEBP, picture_header
from flight_file.frame import JPEG

_CHUNK_OF_PNG = struct.Struct(">I4s")
_CHUNK_OF_WEBP = struct.Struct("<4sI")


def picture_format(data: bytes) -> str:
    """Determine the format by the first bytes; `jpeg` for anything unknown, as a camera of JPEGs may send."""
    return "png" if data.startswith(PNG_START) else "webp" if WEBP.match(data) else JPEG


def picture_facts(data: bytes) -> JpegFacts:
    """Read size and EXIF of a JPEG, PNG or WebP; any bytes may be given, nothing is raised."""
    kind = picture_format(data)
    if kind == JPEG:
        return jpeg_facts(data)
    header = picture_header(data)
    width_px, height_px = (None, None) if header is None else (header.width_px, header.height_px)
    chunks = _chunks_of_png(data) if kind == "png" else _chunks_of_webp(data)
    exif = next((content for name, content in chunks if name.lower() == b"exif"), b"")
    if exif and not exif.startswith(EXIF_PREFIX):
        exif = EXIF_PREFIX + exif
    return JpegFacts(width_px, height_px, exif, whole=header is not None)


def _chunks_of_png(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = len(PNG_START)
    while at + _CHUNK_OF_PNG.size <= len(data):
        length, name = _CHUNK_OF_PNG.unpack_from(data, at)
        at += _CHUNK_OF_PNG.size
        yield name, data[at : at + length] if name == b"eXIf" else b""
        at += length + 4  # its CRC


def _chunks_of_webp(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 12
    while at + _CHUNK_OF_WEBP.size <= len(data):
        name, length = _CHUNK_OF_WEBP.unpack_from(data, at)
        at += _CHUNK_OF_WEBP.size
        yield name, data[at : at + length] if name == b"EXIF" else b""
        at += length + length % 2
