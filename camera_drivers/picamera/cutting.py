"""Cutting what rpicam-vid writes: a stream of bytes into pictures, and lines of metadata into records.

JPEGs follow each other without anything between. H.264 comes in Annex B: NAL units, each behind 00 00 01; a picture
begins with the first of the units that may stand before a picture, or with a slice whose first macroblock is 0, once
the picture before has a slice. So a picture is known to be whole when the next one begins. Source: ITU-T H.264,
7.4.1.2.3.
"""

from __future__ import annotations

from typing import Protocol

from camera_drivers.errors import CameraError
from camera_drivers.jpeg import jpeg_end
from flight_file.documents import EOI, SOI
from flight_file.thresholds import BLOCK_BYTES, MAX_READ_BYTES

_START = b"\0\0\1"
_BEFORE_A_PICTURE = frozenset({6, 7, 8, 9})  # SEI, SPS, PPS, access unit delimiter
_SLICES = range(1, 6)
_FIRST_MACROBLOCK_0 = 0x80
_RECORD_END = b"\n\n"


class Cutter(Protocol):
    """Cuts a stream of bytes."""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the pictures that these bytes complete, in order; raises CameraError if there is no end to one."""
        ...


class JpegCutter:
    """Cuts JPEGs; bytes between them are skipped."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """See `Cutter`."""
        pictures: list[bytes] = []
        looked = max(len(self._buffer) - 1, 0)
        self._buffer += data
        # These two bytes never follow each other in coded data, so most pieces need not be searched again.
        while self._buffer.find(EOI, looked) >= 0:
            start = self._buffer.find(SOI)
            content = bytes(self._buffer)
            end = jpeg_end(content, start) if start >= 0 else None
            if end is None:
                break
            pictures.append(content[start:end])
            del self._buffer[:end]
            looked = 0
        _refuse_endless(self._buffer)
        return pictures


class AccessUnitCutter:
    """Cuts H.264 in Annex B into access units."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._looked = 0
        self._has_slice = False

    def feed(self, data: bytes) -> list[bytes]:
        """See `Cutter`."""
        units: list[bytes] = []
        self._buffer += data
        while True:
            at = self._buffer.find(_START, self._looked)
            first = at + len(_START)
            if at < 0 or first + 1 >= len(self._buffer):
                self._looked = at if at >= 0 else max(len(self._buffer) - len(_START) + 1, 0)
                _refuse_endless(self._buffer)
                return units
            kind = self._buffer[first] & 31
            new_slice = kind in _SLICES and self._buffer[first + 1] & _FIRST_MACROBLOCK_0
            if self._has_slice and (kind in _BEFORE_A_PICTURE or new_slice):
                cut = at - 1 if at > 0 and self._buffer[at - 1] == 0 else at
                units.append(bytes(self._buffer[:cut]))
                del self._buffer[:cut]
                first -= cut
                self._has_slice = False
            self._has_slice = self._has_slice or kind in _SLICES
            self._looked = first


class RecordCutter:
    """Cuts `--metadata-format txt`: lines NAME=VALUE, and an empty line after each picture's."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[dict[str, str]]:
        """Return the records that these bytes complete, values by name."""
        looked = max(len(self._buffer) - 1, 0)
        self._buffer += data
        if self._buffer.find(_RECORD_END, looked) < 0:
            if len(self._buffer) > BLOCK_BYTES:
                self._buffer.clear()
            return []
        *whole, self._buffer = self._buffer.split(_RECORD_END)
        return [
            dict(line.split("=", 1) for line in record.decode("utf-8", "replace").splitlines() if "=" in line)
            for record in whole
        ]


def _refuse_endless(buffer: bytearray) -> None:
    if len(buffer) > MAX_READ_BYTES:
        buffer.clear()
        raise CameraError("rpicam-vid does not send pictures; try its command line by hand.")
