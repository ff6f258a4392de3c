"""One request: its limits hold against every way of not answering, and nobody but the camera is called."""

from __future__ import annotations

import gc
import socket
import threading
import tracemalloc
from contextlib import suppress

import pytest
from urllib3 import HTTPResponse

from camera_drivers.errors import CameraSilentError, CameraUnreachableError
from camera_drivers.qx10.link import Answer, Exchange, Link
from camera_drivers.qx10.options import Qx10Limits
from camera_drivers.reporter import Reporter
from camera_drivers.waiting import Job, Stopped, Waiter
from recorder.host import SystemClock
from tests.camera_drivers.qx10.strangers import OK, Act, Strangers, drip, send, send_a_gigabyte

LIMIT_S = 0.6
MAX_BYTES = 100_000
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


def say_nothing(_connection: socket.socket) -> None:
    """For longer than a call may take."""
    threading.Event().wait(1.5)


CHUNKED = OK + b"Transfer-Encoding: chunked\r\n\r\n"
LATE, BROKEN, LARGE = "no whole answer within its time", "the connection was cut", "larger than allowed"
NO_ANSWERS: dict[str, tuple[Act, str]] = {
    "silence": (say_nothing, LATE),
    "a status that never ends": (drip(b"HTTP/1.1 200 "), LATE),
    "headers that never end": (drip(OK + b"X: "), LATE),
    "a body that never ends": (drip(OK + b"Content-Length: 99999\r\n\r\n"), LATE),
    "a body without length that never ends": (drip(OK + b"\r\n"), LATE),
    "an end at once": (send(b""), BROKEN),
    "no HTTP": (send(b"SSH-2.0-OpenSSH\r\n"), BROKEN),
    "too short": (send(OK + b"Content-Length: 10\r\n\r\nabc"), BROKEN),
    "a chunk too short": (send(CHUNKED + b"a\r\nabc"), BROKEN),
    "no chunk": (send(CHUNKED + b"zz\r\nabc"), BROKEN),
    "no last chunk": (send(CHUNKED + b"3\r\nabc\r\n"), BROKEN),
    "a gigabyte, as it is told": (send_a_gigabyte(b"Content-Length: 1073741824\r\n"), LARGE),
    "a length of thousands of digits": (send(OK + b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n"), LARGE),
    "a gigabyte, untold": (send_a_gigabyte(), LARGE),
    "a gigabyte in chunks": (send_a_gigabyte(b"Transfer-Encoding: chunked\r\n"), LARGE),
}


@pytest.mark.parametrize("name", NO_ANSWERS)
def test_answer_that_is_not_whole_in_time_is_none(strangers: Strangers, link: Link, name: str) -> None:
    """Of a camera that may have got the call; a byte now and then does not make a call last longer."""
    act, sentence = NO_ANSWERS[name]
    with pytest.raises(CameraSilentError, match=sentence):
        get(link, strangers.url(act))


@pytest.mark.parametrize("answer", WHOLE.values(), ids=WHOLE)
def test_whole_answer_is_its_bytes(strangers: Strangers, link: Link, answer: bytes) -> None:
    """However its end is told; nothing is unpacked that was not asked to be packed."""
    assert get(link, strangers.url(send(answer))) == Answer(200, b"abc")


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
    with exchange, pytest.raises(CameraUnreachableError, match="another host's"):
        exchange.fetch("test", "GET", "http://192.0.2.7/", max_bytes=10)


@pytest.mark.parametrize("url", ["", "no url", "https://127.0.0.1/", "http://", "http://[", "http://a:b/"])
def test_address_that_is_none_is_silence(link: Link, url: str) -> None:
    """Whatever the camera gives for an address."""
    with pytest.raises(CameraSilentError, match="an invalid address"):
        get(link, url)


def test_nobody_there_means_not_delivered(link: Link) -> None:
    """The one case where a call was certainly not carried out."""
    with pytest.raises(CameraUnreachableError, match="cannot be reached"):
        get(link, "http://127.0.0.1:9/")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_answer_that_crashes_the_driver_is_no_answer() -> None:
    """A bug that a stranger found is the failure of one call, which is tried again, and not the recording's end."""
    job = Job("test", lambda: 1 // 0)
    job.start()
    job.join()  # its traceback is out

    with pytest.raises(CameraSilentError, match="crashed the driver"):
        job.outcome()


def test_answer_that_no_memory_is_left_for_is_none() -> None:
    """It is the failure of one call, without a traceback."""
    job = Job("test", lambda: bytes(2**62))
    job.start()

    assert job.done.wait(10)
    with pytest.raises(CameraSilentError, match="no memory is left for the answer"):
        job.outcome()


def test_stop_ends_a_call(strangers: Strangers, link: Link) -> None:
    """A call that hangs is left when stopping is asked for."""
    threading.Timer(0.1, link.waiter.stop.set).start()
    with pytest.raises(Stopped):
        get(link, strangers.url(say_nothing))


def test_answer_in_tiny_chunks_takes_no_more_memory_than_its_bytes(strangers: Strangers, link: Link) -> None:
    """A camera that sends a picture in chunks of two bytes had taken thirty times the picture's memory."""
    pieces, size = 40_000, 2
    body = CHUNKED + b"2\r\nab\r\n" * pieces + b"0\r\n\r\n"
    url = strangers.url(send(body))
    tracemalloc.start()
    try:
        answer = link.get("test", url, max_bytes=MAX_BYTES, limit_s=60)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert answer.body == b"ab" * pieces
    assert most < 10 * pieces * size


@pytest.mark.parametrize("act", [send(WHOLE["in chunks"]), NO_ANSWERS["too short"][0]], ids=["whole", "broken off"])
def test_nothing_of_a_call_is_kept(strangers: Strangers, link: Link, act: Act) -> None:
    """However it ends: a box makes half a million of them a day."""
    url = strangers.url(act)
    before = kept()
    for _ in range(50):
        with suppress(CameraSilentError):
            get(link, url)

    assert kept() - before <= 1


def kept() -> int:
    """Requests and answers that are in memory."""
    gc.collect()
    return sum(type(each) in {Exchange, HTTPResponse} for each in gc.get_objects())
