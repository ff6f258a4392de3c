"""The liveview: a stream that never ends by itself, and begins again when it does.

    ┌─▶ ask for its address ──▶ open ──▶ read ──picture──▶ frame ──┐
    │                                    ▲ │                       │
    │                                    └─┼───────────────────────┘
    └── nothing for stall_s, or its end ◀──┘      too often without a picture: CameraError

When a picture was taken is estimated from the camera's own timestamps: pictures come in bursts, but the one that came
fastest of all came hardly later than it was taken, and the timestamps say by how much the others were taken later.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraRefusedError, CameraSilentError
from camera_drivers.qx10.exchange import BROKEN_OFF, CHUNK_BYTES, Exchange
from camera_drivers.qx10.liveview_packets import LivePicture, LiveviewParser
from camera_drivers.qx10.notes import Notes
from camera_drivers.qx10.remote_api import RemoteApi
from flight_file.frame import ClockReading, HostTimes

STATE = "liveview"
TRIES = 4  # to get a picture, before the camera is connected again
REST_S = 1.0  # between the end of a stream and the next

CLOSE_S = 1.0  # for the camera to hear that we leave

_OK = 200
_MAX_WAITING = 64  # pictures that came in one piece


@dataclass(frozen=True, slots=True)
class Live:
    """A picture, the box's clocks while it came, and mid-exposure and its standard deviation by the monotonic clock."""

    jpeg: bytes
    times: HostTimes
    taken: tuple[int, int]


class Liveview:
    """The stream of one camera."""

    def __init__(self, api: RemoteApi, clock: Clock, notes: Notes) -> None:
        self._api = api
        self._clock = clock
        self._notes = notes
        self._exchange: Exchange | None = None
        self._parser = LiveviewParser()
        self._waiting: deque[tuple[LivePicture, ClockReading, ClockReading]] = deque()
        self._delay = Delay()

    def next_picture(self) -> Live:
        """The next picture.

        Raises
        ------
        CameraError
            None can be had until the camera is connected again.
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
                if not error.delivered or tries >= TRIES:
                    raise
                self._notes.say(STATE, f"begins again: {error.problem}")
                self._api.link.patience.pause("the liveview begins again", REST_S)
        picture, before, at = self._waiting.popleft()
        taken = self._delay.taken(picture.timestamp_ms, at.monotonic_ns)
        return Live(picture.jpeg, HostTimes(before_request=before, after_answer=at, downloaded=at), taken)

    def close(self) -> None:
        """End the stream; the camera is told, and may be gone."""
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
                    raise CameraSilentError("liveview", "the stream ended", delivered=True)
                if pictures := self._parser.feed(data):
                    return pictures

        pictures = self._api.link.patience.until_done("liveview", work, exchange.abort, limit_s=limit_s)
        at = self._clock.read()
        self._waiting.extend((picture, before, at) for picture in pictures[:_MAX_WAITING])

    def _open(self) -> Exchange:
        try:
            result = self._api.call("startLiveview")
        except CameraRefusedError as error:
            raise CameraSilentError("startLiveview", "the camera refuses a liveview", delivered=True) from error
        address = result[0] if result and isinstance(result[0], str) else ""
        link = self._api.link
        url = link.own("liveview", address)
        exchange = link.exchange(link.limits.stall_s)
        # From here on it is open as far as the camera is concerned, and has to be closed.
        self._exchange, self._parser, self._delay = exchange, LiveviewParser(), Delay()

        def work() -> int:
            return exchange.open("liveview", "GET", url)

        if link.patience.until_done("liveview", work, exchange.abort, limit_s=link.limits.call_s) != _OK:
            raise CameraSilentError("liveview", BROKEN_OFF, delivered=True)
        return exchange


class Delay:
    """How much later than taken the pictures of one stream come.

    The smallest difference of arrival and timestamp is the one to go by. It is forgotten slowly, as clocks drift.
    """

    DRIFT = 1e-4  # a crystal's, generously
    # The camera needs some time from exposure to sending, which nothing tells; this is our guess at it.
    SIGMA_NS = 100_000_000
    JUMP_NS = 5_000_000_000  # more than any picture is late: the timestamps have begun anew

    def __init__(self) -> None:
        self._least_ns: int | None = None
        self._at_ns = 0

    def taken(self, timestamp_ms: int, arrived_ns: int) -> tuple[int, int]:
        """Mid-exposure of a picture and its standard deviation, ns, by the clock of its arrival."""
        shown_ns = timestamp_ms * 1_000_000
        delay_ns = arrived_ns - shown_ns
        if self._least_ns is not None:
            allowed_ns = self._least_ns + round((arrived_ns - self._at_ns) * self.DRIFT)
            if abs(delay_ns - allowed_ns) < self.JUMP_NS:
                delay_ns = min(delay_ns, allowed_ns)
        self._least_ns, self._at_ns = delay_ns, arrived_ns
        return shown_ns + delay_ns, self.SIGMA_NS
