"""One request: its limits hold against every way of not answering, and nobody but the camera is called."""

from __future__ import annotations

import gc
import threading
from contextlib import suppress

import pytest
from urllib3 import HTTPResponse

from camera_drivers.errors import CameraSilentError, CameraUnreachableError
from camera_drivers.qx10.link import Answer, Exchange, Link
from camera_drivers.qx10.options import Qx10Limits
from camera_drivers.reporter import Reporter
from camera_drivers.waiting import Stopped, Waiter
from recorder.host import SystemClock
from tests.camera_drivers.qx10.strangers import Act, Strangers, drip, send, send_a_gigabyte

LIMIT_S = 0.6
MAX_BYTES = 100_000
BROKEN = {
    "nothing": b"",
    "no HTTP": b"SSH-2.0-OpenSSH\r\n",
    "too short": b"HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nabc",
    "a chunk too short": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\na\r\nabc",
    "no chunk": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\nabc",
    "no last chunk": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n",
}
WHOLE = {
    "with length": b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc",
    "without length": b"HTTP/1.0 200 OK\r\n\r\nabc",
    "in chunks": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n1\r\nc\r\n0\r\n\r\n",
    "as if packed": b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc",
}


@pytest.fixture
def link(listener: Reporter) -> Link:
    """The way to a camera on loopback."""
    return Link("127.0.0.1", Qx10Limits(connect_s=1.0), Waiter(SystemClock(), listener))


def get(link: Link, url: str) -> Answer:
    """Get it."""
    return link.get("test", url, max_bytes=MAX_BYTES, limit_s=LIMIT_S)


HANGS = {
    "nothing": lambda _connection: threading.Event().wait(1.5),
    "a status that never ends": drip(b"HTTP/1.1 200 "),
    "headers that never end": drip(b"HTTP/1.1 200 OK\r\nX: "),
    "a body that never ends": drip(b"HTTP/1.1 200 OK\r\nContent-Length: 99999\r\n\r\n"),
    "a body without length that never ends": drip(b"HTTP/1.1 200 OK\r\n\r\n"),
}


@pytest.mark.parametrize("act", HANGS.values(), ids=HANGS)
def test_limit_is_for_the_whole_of_a_call(strangers: Strangers, link: Link, act: Act) -> None:
    """A byte now and then does not make a call last longer."""
    with pytest.raises(CameraSilentError, match="no whole answer within its time"):
        get(link, strangers.url(act))


@pytest.mark.parametrize("answer", BROKEN.values(), ids=BROKEN)
def test_answer_that_is_not_whole_is_none(strangers: Strangers, link: Link, answer: bytes) -> None:
    """Cut off anywhere, or no HTTP at all: silence, of a camera that may have got the call."""
    with pytest.raises(CameraSilentError, match="the connection broke off"):
        get(link, strangers.url(send(answer)))


@pytest.mark.parametrize("answer", WHOLE.values(), ids=WHOLE)
def test_whole_answer_is_its_bytes(strangers: Strangers, link: Link, answer: bytes) -> None:
    """However its end is told; nothing is unpacked that was not asked to be packed."""
    assert get(link, strangers.url(send(answer))) == Answer(200, b"abc")


@pytest.mark.parametrize(
    "head",
    [b"Content-Length: 1073741824\r\n", b"", b"Transfer-Encoding: chunked\r\n"],
    ids=["told", "untold", "chunks"],
)
def test_answer_of_a_gigabyte_is_refused(strangers: Strangers, link: Link, head: bytes) -> None:
    """At once where the size is announced, and otherwise at the limit."""
    with pytest.raises(CameraSilentError, match="larger than allowed"):
        get(link, strangers.url(send_a_gigabyte(head)))


def test_proxy_of_the_environment_is_ignored(strangers: Strangers, link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera is never behind a proxy, and nowhere else than where it is: a redirect is not followed."""
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "http://192.0.2.7:3128")
    monkeypatch.delenv("no_proxy", raising=False)
    monkeypatch.delenv("NO_PROXY", raising=False)

    assert get(link, strangers.url(send(WHOLE["with length"]))).body == b"abc"
    redirect = b"HTTP/1.1 302 Found\r\nLocation: http://192.0.2.7/\r\nContent-Length: 0\r\n\r\n"
    assert get(link, strangers.url(send(redirect))).status == 302


def test_stranger_is_never_called(strangers: Strangers, link: Link) -> None:
    """A URL of another host leads to the camera's own address, with port and path as they were."""
    own = strangers.url(send(WHOLE["with length"]))
    for host in ("0.0.0.0", "192.0.2.7", "somebody@example.org"):  # noqa: S104 - what a camera may say
        assert get(link, own.replace("127.0.0.1", host)).body == b"abc"
    exchange = link.exchange(1.0)
    with exchange, pytest.raises(CameraUnreachableError, match="a stranger's"):
        exchange.fetch("test", "GET", "http://192.0.2.7/", max_bytes=10)


@pytest.mark.parametrize("url", ["", "no url", "https://127.0.0.1/", "http://", "http://[", "http://a:b/"])
def test_address_that_is_none_is_silence(link: Link, url: str) -> None:
    """Whatever the camera gives for an address."""
    with pytest.raises(CameraSilentError, match="an address that is none"):
        get(link, url)


def test_nobody_there_means_not_delivered(link: Link) -> None:
    """The one case where a call was certainly not carried out."""
    with pytest.raises(CameraUnreachableError, match="cannot be reached"):
        get(link, "http://127.0.0.1:9/")


def test_stop_ends_a_call(strangers: Strangers, link: Link) -> None:
    """A call that hangs is left when stopping is asked for."""
    threading.Timer(0.1, link.waiter.stop.set).start()
    with pytest.raises(Stopped):
        get(link, strangers.url(HANGS["nothing"]))


@pytest.mark.parametrize("answer", [WHOLE["with length"], WHOLE["in chunks"], BROKEN["too short"], BROKEN["nothing"]])
def test_nothing_of_a_call_is_kept(strangers: Strangers, link: Link, answer: bytes) -> None:
    """However it ends: a box makes half a million of them a day."""
    url = strangers.url(send(answer))
    before = kept()
    for _ in range(50):
        with suppress(CameraSilentError):
            get(link, url)

    assert kept() - before <= 1


def kept() -> int:
    """Requests and answers that are in memory."""
    gc.collect()
    return sum(type(each) in {Exchange, HTTPResponse} for each in gc.get_objects())
