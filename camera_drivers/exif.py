"""The EXIF tags in use, read with Pillow; all are optional, and an unreadable tag counts as missing.

| tag                | number | as                                                          |
| ------------------ | ------ | ----------------------------------------------------------- |
| ExposureTime       | 0x829A | s                                                           |
| FNumber            | 0x829D | f-number                                                    |
| ISO                | 0x8827 | whole number, the first if there are several                |
| DateTimeOriginal   | 0x9003 | `YYYY:MM:DD hh:mm:ss` by the camera's clock                 |
| OffsetTimeOriginal | 0x9011 | `+hh:mm`                                                    |
| SubSecTimeOriginal | 0x9291 | digits after the decimal point of the second                |
| FocalLength        | 0x920A | mm                                                          |

Source: CIPA DC-008 (Exif 2.32). The block is at most 64 KiB, since a JPEG segment cannot be longer.
"""

from __future__ import annotations

import re
import struct
import warnings
from datetime import UTC, datetime, timedelta
from typing import Any

from PIL import Image

from flight_file.frame import NS_PER_S, Exif, is_focal_length_mm

_EXIF_IFD = 0x8769
_LONG = 2**32  # no LONG is as large, and so no RATIONAL; what a damaged tag has in another type is no value
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

_DATE = re.compile(r"(\d{4}):(\d\d):(\d\d) (\d\d):(\d\d):(\d\d)")
_OFFSET = re.compile(r"[+-]\d\d:\d\d|Z")
_ISO_TIME = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(\d+))?([+-]\d\d:\d\d|Z)?")

# Exceptions seen from Pillow on damaged blocks; it documents none of them.
_DAMAGE = (
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    ArithmeticError,
    OSError,
    EOFError,
    struct.error,
)


def read_exif(block: bytes) -> Exif:
    """Read the tags of an EXIF block (with its `Exif` prefix); never raises, whatever the bytes."""
    if not block:
        return Exif()
    try:
        tags = _tags(block)
    except _DAMAGE:
        return Exif()
    return Exif(
        focal_length_mm=_focal_length_mm(tags.get(0x920A)),
        exposure_s=_positive(tags.get(0x829A)),
        f_number=_positive(tags.get(0x829D)),
        iso=_iso(tags.get(0x8827)),
        datetime=_datetime(tags.get(0x9003), tags.get(0x9291), tags.get(0x9011)),
    )


def exif_time_ns(text: str | None) -> int | None:
    """Convert an `Exif.datetime` to UTC ns since 1970, taking a time without offset as UTC; None if it is no time."""
    match = _ISO_TIME.fullmatch(text or "")
    if match is None:
        return None
    try:
        moment = datetime.fromisoformat(match[1] + (match[3] or "Z"))
    except ValueError:
        return None
    whole = (moment - _EPOCH) // timedelta(seconds=1)
    return whole * NS_PER_S + int((match[2] or "0")[:9].ljust(9, "0"))


def _tags(block: bytes) -> dict[int, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow warns of truncated blocks; a missing tag shows that already
        exif = Image.Exif()
        exif.load(block)
        return dict(exif.get_ifd(_EXIF_IFD))


def _positive(value: object) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]  # whatever it is, float() decides
    except _DAMAGE:
        return None
    return number if 0 < number < _LONG else None


def _focal_length_mm(value: object) -> float | None:
    length_mm = _positive(value)
    return length_mm if length_mm is not None and is_focal_length_mm(length_mm) else None


def _iso(value: object) -> int | None:
    first = value[0] if isinstance(value, tuple) and value else value
    return first if isinstance(first, int) and 0 < first < _LONG else None


def _text(value: object) -> str:
    return value.strip("\x00 ") if isinstance(value, str) else ""


def _datetime(date: object, fraction: object, offset: object) -> str | None:
    match = _DATE.fullmatch(_text(date))
    if match is None:
        return None
    year, month, day, hour, minute, second = match.groups()
    text = f"{year}-{month}-{day}T{hour}:{minute}:{second}"
    digits = _text(fraction)
    if re.fullmatch(r"[0-9]{1,9}", digits):
        text += f".{digits}"
    zone = _text(offset)
    if _OFFSET.fullmatch(zone):
        text += zone
    return text if exif_time_ns(text) is not None else None
