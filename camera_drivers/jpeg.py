"""What a JPEG's markers say, without decoding it: size, EXIF, where it ends, and whether it has a beginning and an end.

Markers are FF xx; all but a few carry a length u16 (big-endian, counting itself). The size stands in the first SOFn
segment, EXIF in an APP1 segment that begins with `Exif`. Source: ITU-T T.81 annex B; CIPA DC-008 (Exif) 4.7.2.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

SOI = b"\xff\xd8"
EOI = b"\xff\xd9"
EXIF_PREFIX = b"Exif\x00\x00"

_SOS = 0xDA
_APP1 = 0xE1
_SOF = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # these three are DHT, JPG and DAC
_ALONE = frozenset(range(0xD0, 0xD9)) | {0x01}  # RSTn, SOI, TEM: no length follows
_RESTARTS = range(0xD0, 0xD8)
_SIZE = struct.Struct(">BHH")  # bits per sample, height, width
_MAX_SEGMENTS = 1000  # no camera writes more before the picture; garbage might


@dataclass(frozen=True, slots=True)
class JpegFacts:
    """What the markers say.

    Attributes
    ----------
    width_px, height_px
        As in the file, before any EXIF orientation; None where no header could be read.
    exif
        The EXIF block with its prefix; empty if there is none.
    whole
        Whether the data begin with SOI and end with EOI; zeros after the end are allowed, some cameras pad.
    """

    width_px: int | None
    height_px: int | None
    exif: bytes
    whole: bool


def jpeg_facts(data: bytes) -> JpegFacts:
    """Read the markers of a JPEG; any bytes may be given, nothing is raised."""
    size: tuple[int, int] | None = None
    exif = b""
    for marker, content in _segments(data):
        if marker in _SOF and len(content) >= _SIZE.size:
            _, height, width = _SIZE.unpack_from(content)
            size = (width, height) if width and height else None
        elif marker == _APP1 and content.startswith(EXIF_PREFIX) and not exif:
            exif = content
    width_px, height_px = size or (None, None)
    return JpegFacts(width_px=width_px, height_px=height_px, exif=exif, whole=_is_whole(data))


def jpeg_end(data: bytes, start: int = 0) -> int | None:
    """Where the JPEG that begins at `start` ends, just after its EOI; None if what is there is no whole JPEG.

    The markers are followed from the beginning, so the end of a thumbnail is not taken for the end of the picture, nor
    junk after the end for a part of it.
    """
    if data[start : start + 2] != SOI:
        return None
    position: int | None = start + len(SOI)
    scanned = False
    while position is not None and position + 2 <= len(data):
        marker = data[position + 1]
        if data[position] != 0xFF or marker in (0x00, 0x01):  # noqa: PLR2004 - the first byte of every marker
            return None
        if marker == 0xFF:  # noqa: PLR2004 - a fill byte
            position += 1
        elif marker == EOI[1]:
            return position + 2 if scanned else None
        elif marker in _ALONE:
            position += 2
        else:
            length = int.from_bytes(data[position + 2 : position + 4], "big")
            position += 2 + length
            if marker == _SOS:
                scanned = True
                position = _scan_end(data, position)
    return None


def _scan_end(data: bytes, position: int) -> int | None:
    """Where the next marker after a scan's coded data stands; in those, FF is followed by 00 or by a restart."""
    while True:
        position = data.find(b"\xff", position)
        if position < 0 or position + 1 >= len(data):
            return None
        following = data[position + 1]
        if following and following not in _RESTARTS:
            return position
        position += 2


def _is_whole(data: bytes) -> bool:
    end = len(data)
    while end and data[end - 1] == 0:
        end -= 1
    return data.startswith(SOI) and end >= len(SOI) + len(EOI) and data[end - 2 : end] == EOI


def _segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Marker and content of each segment before the picture itself; stops where the markers make no sense."""
    if not data.startswith(SOI):
        return
    position = len(SOI)
    for _ in range(_MAX_SEGMENTS):
        while data[position : position + 2] == b"\xff\xff":  # fill bytes
            position += 1
        if len(data) < position + 4 or data[position] != 0xFF:  # noqa: PLR2004 - the first byte of every marker
            return
        marker = data[position + 1]
        if marker == _SOS:
            return
        if marker in _ALONE:
            position += 2
            continue
        length = int.from_bytes(data[position + 2 : position + 4], "big")
        content = data[position + 4 : position + 2 + length]
        if length < 2 or len(content) != length - 2:  # noqa: PLR2004 - the length counts its own two bytes
            return
        yield marker, content
        position += 2 + length
