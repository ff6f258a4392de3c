"""The contents of a JPEG's markers, without decoding: size, EXIF, where it ends, whether it is whole.

Markers are FF xx; all but a few carry a length u16 (big-endian, counting itself). The size is in the first SOFn
segment, EXIF in an APP1 segment that begins with `Exif`. Source: ITU-T T.81 annex B; CIPA DC-008 (Exif) 4.7.2.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from flight_file.documents import EOI, SOI, SOS, jpeg_segments, picture_header

EXIF_PREFIX = b"Exif\x00\x00"

_APP1 = 0xE1
_ALONE = range(0xD0, 0xD9)  # RSTn, SOI: no length follows
_SCAN_END = re.compile(rb"\xff[^\x00\xd0-\xd7]", re.DOTALL)  # in coded data FF is followed by 00 or by a restart


@dataclass(frozen=True, slots=True)
class JpegFacts:
    """Facts from a JPEG's markers.

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
    if not data.startswith(SOI):
        return JpegFacts(None, None, b"", whole=False)
    header = picture_header(data)
    width_px, height_px = (None, None) if header is None else (header.width_px, header.height_px)
    blocks = (data[start:end] for marker, start, end in jpeg_segments(data) if marker == _APP1)
    exif = next((block for block in blocks if block.startswith(EXIF_PREFIX)), b"")
    return JpegFacts(width_px=width_px, height_px=height_px, exif=exif, whole=_is_whole(data))


def jpeg_end(data: bytes, start: int = 0) -> int | None:
    """Find the end of the JPEG that begins at `start`, just after its EOI; None if no whole JPEG is there.

    The markers are followed from the beginning, so that the end of a thumbnail is not taken for the picture's, nor junk
    after the end for a part of it.
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
            if marker == SOS:
                scanned = True
                end_of_scan = _SCAN_END.search(data, position)
                position = None if end_of_scan is None else end_of_scan.start()
    return None


def _is_whole(data: bytes) -> bool:
    picture = data.rstrip(b"\x00")
    return picture.startswith(SOI) and len(picture) >= len(SOI) + len(EOI) and picture.endswith(EOI)
