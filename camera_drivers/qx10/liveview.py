"""The liveview: a stream meant to be endless, and restarted if it ends.

    ┌─▶ ask for its address ──▶ open ──▶ read ──picture──▶ frame ──┐
    │                                    ▲ │                       │
    │                                    └─┼───────────────────────┘
    └── nothing for stall_s, or its end ◀──┘      too often without a picture: CameraError

The time of a picture is estimated from the camera's own timestamps: pictures come in bursts, but the fastest of all
arrived almost as soon as it was taken, and the timestamps say by how much later the others were taken.

A packet is a common header of 8 bytes, a payload header of 128, the payload and some padding; big-endian.

| at  | bytes | what                                                     |
| --- | ----- | -------------------------------------------------------- |
| 0   | 1     | FF                                                       |
| 1   | 1     | 01 for a picture; others, such as 02, are skipped        |
| 2   | 2     | sequence number, wraps                                   |
| 4   | 4     | timestamp, ms, from an arbitrary start                   |
| 8   | 4     | 24 35 68 79                                              |
| 12  | 3     | size of the payload                                      |
| 15  | 1     | size of the padding                                      |
| 136 |       | the payload: a JPEG, and junk up to a multiple of 128    |

Only consistent data are accepted: a picture begins where a header says so and a JPEG follows, and ends where the JPEG's
own markers say so, within the announced size. The junk after that is dropped. After anything else the search continues
one byte further, so that junk between packets costs no packet, and a truncated packet costs only itself.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraRefusedError, CameraSilentError
from camera_drivers.jpeg import jpeg_end
from camera_drivers.live.delay import Delay
from camera_drivers.qx10.link import BROKEN_OFF, CHUNK_BYTES, Exchange
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.thresholds import CLOSE_S, MAX_ANSWER_BYTES, MAX_FAILURES, REST_S
from camera_drivers.waiting import Notes
from flight_file.documents import SOI
from flight_file.frame import ClockReading, HostTimes

HEADER_BYTES = 136
_PICTURE = b"\xff\x01"
_START = b"\x24\x35\x68\x79"
_START_AT = 8
_HEADER = struct.Struct(">2sHI4sI")  # the last field: the payload's size in three bytes, the padding's in one
STATE = "liveview"
_OK = 200
_NS_PER_MS = 1_000_000
# The time from exposure to sending is unknown; this is our guess.
_SIGMA_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class LivePicture:
    """A picture cut out of the liveview's bytes.

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
    """Cuts a stream of bytes into pictures."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[LivePicture]:
        """Return the pictures that these bytes complete, in order."""
        self._buffer += data
        content = bytes(self._buffer)
        pictures = []
        done = waiting = 0
        for start in _starts(content):
            if start < done:  # within a picture that was whole
                continue
            size = _size(content, start)
            if start + HEADER_BYTES + size > len(content):
                # It may be the start of a packet, or junk that looks like one: a whole packet that begins after it
                # decides.
                waiting = waiting or start + 1
                continue
            picture = _picture(content, start, size)
            if picture is not None:
                pictures.append(picture)
                done, waiting = start + HEADER_BYTES + len(picture.jpeg), 0
        # Bytes that cannot begin a packet any more are not searched again.
        keep = waiting - 1 if waiting else max(done, len(content) - HEADER_BYTES - len(SOI) + 1)
        del self._buffer[:keep]
        return pictures


def _starts(content: bytes) -> Iterator[int]:
    """Find where a packet with a picture may begin."""
    found = content.find(_START)
    while found >= 0:
        start = found - _START_AT
        if (
            start >= 0
            and content.startswith(_PICTURE, start)
            and content.startswith(SOI, start + HEADER_BYTES)
            and len(SOI) <= _size(content, start) <= MAX_ANSWER_BYTES
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


@dataclass(frozen=True, slots=True)
class Live:
    """A picture with the box's clocks, and mid-exposure and its standard deviation by the monotonic clock."""

    jpeg: bytes
    times: HostTimes
    taken: tuple[int, int]


class Liveview:
    """The liveview stream of one camera."""

    def __init__(self, api: RemoteApi, clock: Clock, notes: Notes) -> None:
        self._api = api
        self._clock = clock
        self._notes = notes
        self._exchange: Exchange | None = None
        self._parser = LiveviewParser()
        self._waiting: deque[tuple[LivePicture, ClockReading, ClockReading]] = deque()
        self._delay = Delay()

    def next_picture(self) -> Live:
        """Wait for the next picture.

        Raises
        ------
        CameraError
            There are none until the camera is connected again.
        Stopped
            Stopping was asked for.
        """
        tries = 0
        while not self._waiting:
            try:
                self._read()
            except CameraSilentError as error:
                self.close()
                tries += 1
                if tries >= MAX_FAILURES:
                    raise
                self._notes.say(STATE, f"begins again: {error.problem}")
                self._api.link.waiter.pause("the liveview restarts", REST_S)
        picture, before, at = self._waiting.popleft()
        taken_ns = self._delay.taken_ns(picture.timestamp_ms * _NS_PER_MS, at.monotonic_ns)
        times = HostTimes(before_request=before, after_answer=at, downloaded=at)
        return Live(picture.jpeg, times, (taken_ns, _SIGMA_NS))

    def close(self) -> None:
        """Stop the stream and inform the camera, which may be gone."""
        if self._exchange is None:
            return
        self._exchange.abort()
        self._exchange.close()
        self._exchange = None
        try:
            self._api.call("stopLiveview", limit_s=CLOSE_S)
        except CameraError:
            return

    def _read(self) -> None:
        """Read until at least one picture is whole."""
        exchange = self._exchange or self._open()
        limit_s = self._api.link.limits.stall_s
        before = self._clock.read()

        def work() -> list[LivePicture]:
            while True:
                data = exchange.read("liveview", CHUNK_BYTES)
                if not data:
                    raise CameraSilentError("liveview", "the stream ended")
                if pictures := self._parser.feed(data):
                    return pictures

        pictures = self._api.link.waiter.until_done("liveview", work, exchange.abort, limit_s=limit_s)
        at = self._clock.read()
        self._waiting.extend((picture, before, at) for picture in pictures)

    def _open(self) -> Exchange:
        try:
            result = self._api.call("startLiveview")
        except CameraRefusedError as error:
            raise CameraSilentError("startLiveview", "the camera refuses a liveview") from error
        address = result[0] if result and isinstance(result[0], str) else ""
        link = self._api.link
        url = link.own("liveview", address)
        exchange = link.exchange(link.limits.stall_s)
        # From here on the camera considers it open, so it must be closed.
        self._exchange, self._parser, self._delay = exchange, LiveviewParser(), Delay()

        def work() -> int:
            return exchange.open("liveview", "GET", url)

        if link.waiter.until_done("liveview", work, exchange.abort, limit_s=link.limits.call_s) != _OK:
            raise CameraSilentError("liveview", BROKEN_OFF)
        return exchange
