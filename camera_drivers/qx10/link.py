"""The link to one camera: one HTTP request at a time, each on its own connection and within a total time limit.

Another thread may end a request at any moment. No connection is reused: once one was established, the camera may have
received the request, otherwise it certainly has not, and after a lost answer only this difference matters. The
environment's proxies are ignored, redirects are not followed, and only the camera is ever called.
"""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from dataclasses import dataclass
from http.client import HTTPException
from types import TracebackType
from typing import Self

from urllib3 import BaseHTTPResponse
from urllib3.connection import HTTPConnection
from urllib3.exceptions import HTTPError
from urllib3.util import parse_url

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraSilentError, CameraUnreachableError
from camera_drivers.qx10.addresses import HTTP_PORT, BadUrlError, at_host, host_of
from camera_drivers.qx10.options import Qx10Limits
from camera_drivers.reporter import Reporter
from camera_drivers.thresholds import CLOSE_S
from camera_drivers.waiting import Waiter

CHUNK_BYTES = 64 * 1024
BROKEN_OFF = "the connection was cut"
_DIGITS = 18  # of a number of 64 bits
TOO_LARGE = "the answer is larger than allowed"
_HEADERS = {"Connection": "close", "Accept-Encoding": "identity", "User-Agent": "image-flight-recorder"}
_FAILURES = (HTTPError, HTTPException, OSError, ValueError)  # the last: garbled headers


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP status, and a body that is complete if its length was announced."""

    status: int
    body: bytes


class Exchange:
    """One request and its answer.

    Parameters
    ----------
    host
        The camera's host; a URL of another host is refused.
    connect_s, quiet_s
        How long connecting, and waiting for the next byte, may take. The total limit is up to the caller, who calls
        `abort`.
    """

    def __init__(self, host: str, *, connect_s: float, quiet_s: float) -> None:
        self._host = host
        self._connect_s = connect_s
        self._quiet_s = quiet_s
        self._connection: HTTPConnection | None = None
        self._response: BaseHTTPResponse | None = None
        self._socket: socket.socket | None = None
        self._aborted = False
        self._reading = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; a thread that still reads from it must be aborted first."""
        if not self._reading.acquire(timeout=CLOSE_S):  # it hangs for good, and keeps its resources
            return
        try:
            if self._response is not None:
                self._response.close()
            if self._connection is not None:
                self._connection.close()
        finally:
            self._reading.release()

    def fetch(self, call: str, method: str, url: str, *, max_bytes: int, body: bytes | None = None) -> Answer:
        """Send a request and read the whole answer.

        Raises
        ------
        CameraUnreachableError
            No connection.
        CameraSilentError
            No HTTP, cut off, or larger than `max_bytes`.
        """
        status = self.open(call, method, url, body=body)
        if self._announced_bytes() > max_bytes:
            raise CameraSilentError(call, TOO_LARGE)
        body_so_far = bytearray()  # not the parts: of two bytes each, they take thirty times the memory
        while part := self.read(call, CHUNK_BYTES):
            body_so_far += part
            if len(body_so_far) > max_bytes:
                raise CameraSilentError(call, TOO_LARGE)
        return Answer(status, bytes(body_so_far))

    def open(self, call: str, method: str, url: str, *, body: bytes | None = None) -> int:
        """Send a request and return the HTTP status as soon as the headers are there."""
        if host_of(url) != host_of(f"http://{self._host}"):
            raise CameraUnreachableError(call, "the address is another host's")
        try:
            self._response = self._request(method, url, body)
        except _FAILURES as error:
            raise self._failed(call) from error
        return self._response.status

    def read(self, call: str, size: int) -> bytes:
        """Read up to this many bytes of the body as soon as there are any; empty at its end."""
        if self._response is None:
            raise CameraUnreachableError(call, BROKEN_OFF)
        try:
            with self._reading:
                if self._aborted:  # and perhaps closed already
                    raise self._failed(call)
                return self._response.read1(size, decode_content=False)
        except _FAILURES as error:
            raise self._failed(call) from error

    def abort(self) -> None:
        """Abort it from another thread: any pending operation fails at once."""
        self._aborted = True
        if self._socket is not None:
            with suppress(OSError):  # it was over already
                self._socket.shutdown(socket.SHUT_RDWR)

    def _announced_bytes(self) -> int:
        length = "" if self._response is None else self._response.headers.get("Content-Length", "")
        # So many digits are too many bytes whatever follows, and Python converts no number of thousands.
        return int(length[:_DIGITS]) if length.isascii() and length.isdigit() else 0

    def _request(self, method: str, url: str, body: bytes | None) -> BaseHTTPResponse:
        parts = parse_url(url)
        connection = self._connection = HTTPConnection(self._host, parts.port or HTTP_PORT, timeout=self._connect_s)
        connection.connect()
        self._socket = connection.sock
        if self._aborted:
            raise OSError("aborted")
        connection.timeout = self._quiet_s
        connection.request(method, parts.request_uri, body, _HEADERS, preload_content=False)
        return connection.getresponse()

    def _failed(self, call: str) -> CameraError:
        if self._socket is None:
            return CameraUnreachableError(call, "the camera cannot be reached")
        return CameraSilentError(call, BROKEN_OFF)


class Link:
    """Requests to one camera, from one thread; each has a total time limit.

    Parameters
    ----------
    host
        The camera's address; no other is ever called.
    """

    def __init__(self, host: str, limits: Qx10Limits, waiter: Waiter) -> None:
        self.host = host
        self.limits = limits
        self.waiter = waiter

    def get(self, call: str, url: str, *, max_bytes: int, limit_s: float) -> Answer:
        """Fetch a URL from the camera, whatever host it names; raises CameraError and Stopped."""
        return self._fetch(call, "GET", self.own(call, url), None, max_bytes=max_bytes, limit_s=limit_s)

    def post(self, call: str, url: str, body: bytes, *, max_bytes: int, limit_s: float) -> Answer:
        """Post a body and return the answer; raises as `get`."""
        return self._fetch(call, "POST", self.own(call, url), body, max_bytes=max_bytes, limit_s=limit_s)

    def own(self, call: str, url: str) -> str:
        """Put the camera's own host into a URL; raises CameraSilentError if it is not a URL."""
        try:
            return at_host(url, self.host)
        except BadUrlError as error:
            raise CameraSilentError(call, "the camera gave an invalid address") from error

    def exchange(self, quiet_s: float) -> Exchange:
        """Prepare a request without sending it."""
        return Exchange(self.host, connect_s=self.limits.connect_s, quiet_s=quiet_s)

    def parallel(self, clock: Clock, reporter: Reporter) -> Link:
        """Open a second link to the same camera, for another thread."""
        return Link(self.host, self.limits, Waiter(clock, reporter))

    def _fetch(self, call: str, method: str, url: str, body: bytes | None, *, max_bytes: int, limit_s: float) -> Answer:
        exchange = self.exchange(2 * limit_s)  # calls are ended by the total limit

        def work() -> Answer:
            with exchange:
                return exchange.fetch(call, method, url, body=body, max_bytes=max_bytes)

        return self.waiter.until_done(call, work, exchange.abort, limit_s=limit_s)
