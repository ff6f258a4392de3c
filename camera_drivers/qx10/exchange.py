"""One HTTP request to the camera, on a connection of its own, which another thread may end at any moment.

Nothing is reused: when a connection stood, the camera may have got the request, and when none stood it certainly has
not; the one difference that matters after a lost answer. The environment's proxies are ignored, redirects are not
followed, and nobody but the camera is ever called.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from http.client import HTTPException
from types import TracebackType
from typing import Any, Self

import requests
from requests.adapters import HTTPAdapter
from urllib3.connection import HTTPConnection
from urllib3.connectionpool import ConnectionPool, HTTPConnectionPool
from urllib3.exceptions import HTTPError

from camera_drivers.errors import CameraSilentError
from camera_drivers.qx10.addresses import host_of

CHUNK_BYTES = 64 * 1024
CLOSE_S = 1.0  # for an aborted reader to notice
BROKEN_OFF = "the connection broke off"
TOO_LARGE = "the answer is larger than allowed"

_HEADERS = {"Connection": "close", "Accept-Encoding": "identity", "User-Agent": "image-flight-recorder"}
_FAILURES = (requests.RequestException, HTTPError, HTTPException, OSError, ValueError)  # the last: garbled headers


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP status and a body that is whole, as far as its length was announced."""

    status: int
    body: bytes


class Exchange:
    """One request and its answer.

    Parameters
    ----------
    host
        The camera's; a URL of another host is refused.
    connect_s, quiet_s
        How long it may take until a connection stands, and until the next byte comes. The limit for the whole is up to
        the caller, who calls `abort`.
    """

    def __init__(self, host: str, *, connect_s: float, quiet_s: float) -> None:
        self._host = host
        self._timeout = (connect_s, quiet_s)
        self._socket: socket.socket | None = None
        self._aborted = False
        self._reading = threading.Lock()
        self._session = requests.Session()
        self._session.trust_env = False
        self._session.headers.clear()
        self._session.headers.update(_HEADERS)
        self._session.adapters.clear()
        self._session.mount("http://", _Adapter(self._connected))
        self._response: requests.Response | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the connection back to the system; a thread that still reads from it has to be aborted before."""
        if not self._reading.acquire(timeout=CLOSE_S):  # it hangs for good, and keeps what it has
            return
        try:
            if self._response is not None:
                self._response.close()
            self._session.close()
        finally:
            self._reading.release()

    def fetch(self, call: str, method: str, url: str, *, max_bytes: int, body: bytes | None = None) -> Answer:
        """Send a request and read the whole answer.

        Raises
        ------
        CameraSilentError
            No connection, no HTTP, cut off, or larger than `max_bytes`.
        """
        status = self.open(call, method, url, body=body)
        parts: list[bytes] = []
        size = 0
        if self._announced_bytes() > max_bytes:
            raise CameraSilentError(call, TOO_LARGE, delivered=True)
        while part := self.read(call, CHUNK_BYTES):
            size += len(part)
            if size > max_bytes:
                raise CameraSilentError(call, TOO_LARGE, delivered=True)
            parts.append(part)
        return Answer(status, b"".join(parts))

    def open(self, call: str, method: str, url: str, *, body: bytes | None = None) -> int:
        """Send a request; gives the HTTP status as soon as the headers are there."""
        if host_of(url) != host_of(f"http://{self._host}"):
            raise CameraSilentError(call, "the address is a stranger's", delivered=False)
        try:
            self._response = self._session.request(
                method, url, data=body, timeout=self._timeout, stream=True, allow_redirects=False
            )
        except _FAILURES as error:
            raise self._failed(call) from error
        return self._response.status_code

    def read(self, call: str, size: int) -> bytes:
        """Up to so many bytes of the answer's body, as soon as there are any; empty at its end."""
        if self._response is None:
            raise CameraSilentError(call, BROKEN_OFF, delivered=False)
        try:
            with self._reading:
                if self._aborted:  # and perhaps closed already
                    raise self._failed(call)
                data = self._response.raw.read1(size, decode_content=False)
        except _FAILURES as error:
            raise self._failed(call) from error
        return bytes(data)

    def abort(self) -> None:
        """End it from another thread: whatever it waits for fails at once."""
        self._aborted = True
        if self._socket is not None:
            with suppress(OSError):  # it was over already
                self._socket.shutdown(socket.SHUT_RDWR)

    def _announced_bytes(self) -> int:
        length = "" if self._response is None else self._response.headers.get("Content-Length", "")
        return int(length) if length.isascii() and length.isdigit() else 0

    def _connected(self, sock: socket.socket) -> None:
        self._socket = sock
        if self._aborted:
            raise OSError("aborted")

    def _failed(self, call: str) -> CameraSilentError:
        if self._socket is None:
            return CameraSilentError(call, "the camera cannot be reached", delivered=False)
        return CameraSilentError(call, BROKEN_OFF, delivered=True)


class _Connection(HTTPConnection):
    """Tells which socket it got."""

    def __init__(self, connected: Callable[[socket.socket], None], *args: Any, **kwargs: Any) -> None:  # noqa: ANN401
        super().__init__(*args, **kwargs)
        self._tell = connected

    def connect(self) -> None:
        """Connect, and tell."""
        super().connect()
        self._tell(self.sock)


class _Adapter(HTTPAdapter):
    """Makes connections that tell which socket they got; never tries twice."""

    def __init__(self, connected: Callable[[socket.socket], None]) -> None:
        super().__init__(pool_connections=1, pool_maxsize=1, max_retries=0)
        self._tell = connected

    def get_connection_with_tls_context(self, *args: Any, **kwargs: Any) -> ConnectionPool:  # noqa: ANN401
        """The pool that requests wants, with our kind of connection in it."""
        pool = super().get_connection_with_tls_context(*args, **kwargs)
        if isinstance(pool, HTTPConnectionPool):
            pool.ConnectionCls = partial(_Connection, self._tell)  # type: ignore[assignment]  # it is only called
        return pool
