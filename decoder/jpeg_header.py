"""What a JPEG's header says of its size: enough to give it memory before it is decompressed, if it can be true."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_START = b"\xff\xd8\xff"
_END = b"\xff\xd9"
_SIZES = frozenset((0xC0, 0xC1, 0xC2))  # baseline, extended, progressive
_SEQUENTIAL = frozenset((0xC0, 0xC1))
_SCAN = 0xDA
# A bit for each block of 8 x 8 pixels, whose coefficients can hardly be told in less.
MOST_PIXELS_A_BYTE = 512
MOST_PIXELS = 2**27  # the largest sensors have no more
FEW_PIXELS = 2**22  # are tried in any case: four megabytes
# A segment's start, as far as it is one of sizes: marker, kind, length, precision, height, width.
_SEGMENT = struct.Struct(">BBHBHH")
_HEIGHT_AT = 5


@dataclass(frozen=True, slots=True)
class JpegHeader:
    """Size in pixels, and where in the file the height stands.

    `is_sequential`: rows follow each other from top to bottom, all of them in the file.
    """

    height_px: int
    width_px: int
    height_at: int
    is_sequential: bool

    def fits(self, size_bytes: int) -> bool:
        """Whether a file of so many bytes can be a picture as large as this; a damaged header may claim anything."""
        most = max(FEW_PIXELS, min(size_bytes * MOST_PIXELS_A_BYTE, MOST_PIXELS))
        return self.height_px * self.width_px <= most


def jpeg_header(encoded: bytes) -> JpegHeader | None:
    """The header of a JPEG; None if it is none, or not one of the usual kinds."""
    if not encoded.startswith(_START):
        return None
    at, last = 2, len(encoded) - _SEGMENT.size
    while at < last:
        marker, kind, length, _, height, width = _SEGMENT.unpack_from(encoded, at)
        if marker != _START[0] or kind == _SCAN:
            return None
        if kind in _SIZES:
            whole = kind in _SEQUENTIAL and encoded.endswith(_END)
            return JpegHeader(height, width, at + _HEIGHT_AT, whole) if height and width else None
        at += 2 + length
    return None
