"""The liveview's bytes, cut into pictures.

A packet is a common header of 8 bytes, a payload header of 128, the payload and some padding; big-endian.

| at  | bytes | what                                                     |
| --- | ----- | -------------------------------------------------------- |
| 0   | 1     | FF                                                       |
| 1   | 1     | 01 for a picture; others, such as 02, are passed over    |
| 2   | 2     | sequence number, wraps                                   |
| 4   | 4     | timestamp, ms, from an arbitrary start                   |
| 8   | 4     | 24 35 68 79                                              |
| 12  | 3     | size of the payload                                      |
| 15  | 1     | size of the padding                                      |
| 136 |       | the payload: a JPEG, and junk up to a multiple of 128    |

Nothing in it is believed that does not fit together: a picture begins where a header says so and a JPEG follows, and
ends where the JPEG's own markers say so, within the announced size. The junk after that is no part of the picture and
is left out. After anything else the search goes on one byte further, so junk between packets costs no packet, and a
packet that was cut off costs only itself.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from camera_drivers.jpeg import SOI, jpeg_end

MAX_PAYLOAD_BYTES = 2**20  # pictures of 640x480 were seen with 9 to 14 kB
HEADER_BYTES = 136

_PICTURE = b"\xff\x01"
_START = b"\x24\x35\x68\x79"
_START_AT = 8
_HEADER = struct.Struct(">2sHI4sI")  # the last holds the payload's size in three bytes, the padding's in one


@dataclass(frozen=True, slots=True)
class LivePicture:
    """A picture of the liveview.

    Attributes
    ----------
    number
        0 to 65535, wraps.
    timestamp_ms
        By the camera, from an arbitrary start.
    """

    number: int
    timestamp_ms: int
    jpeg: bytes


class LiveviewParser:
    """Takes bytes as they come and gives pictures as soon as they are whole."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[LivePicture]:
        """The pictures that have become whole with these bytes, in order."""
        self._buffer += data
        content = bytes(self._buffer)
        pictures = []
        done = waiting = 0
        for start in _starts(content):
            if start < done:  # within a picture that was whole
                continue
            size = _size(content, start)
            if start + HEADER_BYTES + size > len(content):
                # It may be a packet of which the rest is to come, or junk that looks like one: a whole one that begins
                # behind it decides.
                waiting = waiting or start + 1
                continue
            picture = _picture(content, start, size)
            if picture is not None:
                pictures.append(picture)
                done, waiting = start + HEADER_BYTES + len(picture.jpeg), 0
        # What cannot be the beginning of a packet any more is not looked at again.
        keep = waiting - 1 if waiting else max(done, len(content) - HEADER_BYTES - len(SOI) + 1)
        del self._buffer[:keep]
        return pictures


def _starts(content: bytes) -> Iterator[int]:
    """Where a packet with a picture may begin."""
    found = content.find(_START)
    while found >= 0:
        start = found - _START_AT
        if (
            start >= 0
            and content.startswith(_PICTURE, start)
            and content.startswith(SOI, start + HEADER_BYTES)
            and len(SOI) <= _size(content, start) <= MAX_PAYLOAD_BYTES
        ):
            yield start
        found = content.find(_START, found + 1)


def _size(content: bytes, start: int) -> int:
    return int.from_bytes(content[start + 12 : start + 15], "big")


def _picture(content: bytes, start: int, size: int) -> LivePicture | None:
    _, number, timestamp_ms, _, _ = _HEADER.unpack_from(content, start)
    payload = content[start + HEADER_BYTES : start + HEADER_BYTES + size]
    end = jpeg_end(payload)
    return None if end is None else LivePicture(number, timestamp_ms, payload[:end])
