"""One request: its limits hold against every way of not answering, and nobody but the camera is called."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from camera_drivers.errors import CameraSilentError
from camera_drivers.qx10.exchange import Answer
from camera_drivers.qx10.link import Link
from camera_drivers.qx10.options import Limits
from camera_drivers.qx10.patience import Patience, Stopped
from camera_drivers.reporter import Reporter
from recorder.clock import SystemClock

Act = Callable[[socket.socket], None]
Serve = Callable[[Act], str]

LIMIT_S = 0.6
MAX_BYTES = 100_000


@pytest.fixture
def serve() -> Iterator[Serve]:
    """A server that does the same to every connection, in words of bytes; gives its address."""
    stop = threading.Event()
    servers = []

    def start(act: Act) -> str:
        server = socket.create_server(("127.0.0.1", 0))
        server.settimeout(0.05)
        servers.append(server)

        def accept() -> None:
            while not stop.is_set():
                with suppress(TimeoutError):
                    connection, _ = server.accept()
                    with connection, suppress(OSError):
                        connection.settimeout(2)
                        connection.recv(65536)
                        act(connection)

        threads.append(threading.Thread(target=accept, daemon=True))
        threads[-1].start()
        return f"http://127.0.0.1:{server.getsockname()[1]}/x"

    threads: list[threading.Thread] = []
    yield start
    stop.set()
    for thread in threads:
        thread.join()
    for server in servers:
        server.close()


@pytest.fixture
def link(listener: Reporter) -> Link:
    """The way to a camera on loopback."""
    return Link("127.0.0.1", Limits(connect_s=1.0), Patience(SystemClock(), listener))


def get(link: Link, url: str) -> Answer:
    """Get it."""
    return link.get("test", url, max_bytes=MAX_BYTES, limit_s=LIMIT_S)


def drip(head: bytes) -> Act:
    """A byte now and then, for longer than anybody waits."""

    def act(connection: socket.socket) -> None:
        connection.sendall(head)
        while True:
            connection.sendall(b"x")
            threading.Event().wait(0.05)

    return act


HANGS = {
    "nothing": lambda _connection: threading.Event().wait(1.5),
    "a status that never ends": drip(b"HTTP/1.1 200 "),
    "headers that never end": drip(b"HTTP/1.1 200 OK\r\nX: "),
    "a body that never ends": drip(b"HTTP/1.1 200 OK\r\nContent-Length: 99999\r\n\r\n"),
    "a body without length that never ends": drip(b"HTTP/1.1 200 OK\r\n\r\n"),
}


@pytest.mark.parametrize("act", HANGS.values(), ids=HANGS)
def test_limit_is_for_the_whole_of_a_call(serve: Serve, link: Link, act: Act) -> None:
    """A byte now and then does not make a call last longer."""
    with pytest.raises(CameraSilentError, match="no whole answer within its time") as caught:
        get(link, serve(act))
    assert caught.value.delivered


def send(answer: bytes) -> Act:
    """Send and close."""
    return lambda connection: connection.sendall(answer)


BROKEN = {
    "nothing": b"",
    "no HTTP": b"SSH-2.0-OpenSSH\r\n",
    "too short": b"HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nabc",
    "a chunk too short": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\na\r\nabc",
    "no chunk": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nabc",
    "no last chunk": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n",
}


@pytest.mark.parametrize("answer", BROKEN.values(), ids=BROKEN)
def test_answer_that_is_not_whole_is_none(serve: Serve, link: Link, answer: bytes) -> None:
    """Cut off anywhere, or no HTTP at all: silence, of a camera that may have got the call."""
    with pytest.raises(CameraSilentError, match="the connection broke off") as caught:
        get(link, serve(send(answer)))
    assert caught.value.delivered


WHOLE = {
    "with length": b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc",
    "without length": b"HTTP/1.0 200 OK\r\n\r\nabc",
    "in chunks": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n1\r\nc\r\n0\r\n\r\n",
    "as if packed": b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc",
}


@pytest.mark.parametrize("answer", WHOLE.values(), ids=WHOLE)
def test_whole_answer_is_its_bytes(serve: Serve, link: Link, answer: bytes) -> None:
    """However its end is told; nothing is unpacked that was not asked to be packed."""
    assert get(link, serve(send(answer))) == Answer(200, b"abc")


@pytest.mark.parametrize(
    "head",
    [b"Content-Length: 1073741824\r\n", b"", b"Transfer-Encoding: chunked\r\n"],
    ids=["told", "untold", "chunks"],
)
def test_answer_of_a_gigabyte_is_refused(serve: Serve, link: Link, head: bytes) -> None:
    """At once where the size is announced, and otherwise at the limit."""

    def act(connection: socket.socket) -> None:
        connection.sendall(b"HTTP/1.1 200 OK\r\n" + head + b"\r\n")
        for _ in range(2**14):
            connection.sendall((b"10000\r\n" if b"chunked" in head else b"") + bytes(65536) + b"\r\n")

    with pytest.raises(CameraSilentError, match="larger than allowed"):
        get(link, serve(act))


def test_redirect_is_not_followed(serve: Serve, link: Link) -> None:
    """Neither to a stranger nor to itself."""
    answer = b"HTTP/1.1 302 Found\r\nLocation: http://192.0.2.7/\r\nContent-Length: 0\r\n\r\n"

    assert get(link, serve(send(answer))).status == 302


def test_proxy_of_the_environment_is_ignored(serve: Serve, link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera is never behind a proxy."""
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "http://192.0.2.7:3128")
    monkeypatch.delenv("no_proxy", raising=False)
    monkeypatch.delenv("NO_PROXY", raising=False)

    assert get(link, serve(send(WHOLE["with length"]))).body == b"abc"


def test_stranger_is_never_called(serve: Serve, link: Link) -> None:
    """A URL of another host leads to the camera's own address, with port and path as they were."""
    paths = []

    def act(connection: socket.socket) -> None:
        connection.sendall(WHOLE["with length"])

    own = serve(act)
    paths.append(get(link, own.replace("127.0.0.1", "0.0.0.0")).body)  # noqa: S104 - what a camera may say
    paths.append(get(link, own.replace("127.0.0.1", "192.0.2.7")).body)
    paths.append(get(link, own.replace("//127.0.0.1", "//somebody@example.org")).body)

    assert paths == [b"abc"] * 3
    exchange = link.exchange(1.0)
    with exchange, pytest.raises(CameraSilentError, match="a stranger's"):
        exchange.fetch("test", "GET", "http://192.0.2.7/", max_bytes=10)


@pytest.mark.parametrize("url", ["", "no url", "https://127.0.0.1/", "http://", "http://[", "http://a:b/"])
def test_address_that_is_none_is_silence(link: Link, url: str) -> None:
    """Whatever the camera gives for an address."""
    with pytest.raises(CameraSilentError, match="an address that is none"):
        get(link, url)


def test_nobody_there_means_not_delivered(link: Link) -> None:
    """The one case where a call was certainly not carried out."""
    with pytest.raises(CameraSilentError, match="cannot be reached") as caught:
        get(link, "http://127.0.0.1:9/")
    assert not caught.value.delivered


def test_stop_ends_a_call(serve: Serve, link: Link) -> None:
    """A call that hangs is left when stopping is asked for."""
    threading.Timer(0.1, link.patience.stop.set).start()
    with pytest.raises(Stopped):
        get(link, serve(HANGS["nothing"]))
