"""Finding the camera: whom to believe, and what a description must be."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import count, takewhile
from typing import Any
from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraNotFoundError
from camera_drivers.qx10.camera import Qx10Camera
from camera_drivers.qx10.discovery import first_camera, location, parse_description
from camera_drivers.qx10.options import Qx10Limits, Qx10Settings
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from camera_drivers.reporter import Reporter
from camera_drivers.thresholds import MAX_DESCRIPTIONS
from camera_drivers.waiting import Stopped, Waiter
from recorder.host import SystemClock
from tests.camera_drivers.listening import Listener, no_more_files
from tests.camera_drivers.qx10.conftest import QUICK, settings_for
from tests.camera_drivers.qx10.strangers import OK, Act, Strangers, drip, send, send_a_gigabyte

MakeBench = Callable[..., Any]

URN = "urn:schemas-sony-com:service:ScalarWebAPI:1"
CAMERA = "10.0.0.1"
LOCATION = "http://10.0.0.1:64321/DmsRmtDesc.xml"


def answer(status: str = "HTTP/1.1 200 OK", service: str = URN, url: str = LOCATION) -> bytes:
    """As the camera answers a search."""
    return f"{status}\r\nEXT: \r\nLOCATION: {url}\r\nServer: x\r\nst: {service}\r\n\r\n".encode("latin-1")


@pytest.mark.parametrize(
    "strange",
    [
        answer("HTTP/1.1 404 Not Found"),
        answer("NOTIFY * HTTP/1.1"),
        answer(service="upnp:rootdevice"),
        answer(url="http://192.0.2.7:64321/DmsRmtDesc.xml"),
        answer(url="http://0.0.0.0:64321/DmsRmtDesc.xml"),
        answer(url="http://10.0.0.1:64321/reboot?now=1"),
        answer(url="http://admin@10.0.0.1:64321/DmsRmtDesc.xml"),
        answer(url="https://10.0.0.1/x"),
        answer(url=""),
        b"",
    ],
)
def test_answer_of_a_stranger_is_ignored(strange: bytes) -> None:
    """Another service, another address than its sender's, or no answer at all; the camera's own names its page."""
    assert location(strange, CAMERA) is None
    assert location(answer(), CAMERA) == LOCATION


@pytest.mark.parametrize("sender", ["192.0.2.7", "8.8.8.8", "172.32.0.1", "0.0.0.0", "224.0.0.1"])  # noqa: S104
def test_only_who_is_on_a_network_of_the_box_is_asked(sender: str) -> None:
    """A sender can be forged: nobody out there is called because of an answer."""
    assert location(answer(url=f"http://{sender}:64321/DmsRmtDesc.xml"), sender) is None


@given(data=st.binary(max_size=200))
def test_any_datagram_may_come(data: bytes) -> None:
    """Nothing is raised."""
    assert location(data, CAMERA) is None


def test_camera_is_found_among_strangers(make_bench: MakeBench) -> None:
    """Without a URL: it is asked for on the wanted network, and strangers that answer first are passed over."""
    bench = make_bench("stranger@1")
    camera = make_bench(url=None, interface="lo", search_address=bench.simulated.search_address)

    assert len(camera.take(1)) == 1
    assert len(bench.simulated.ledger.taken) == 1


def test_nobody_answers(make_bench: MakeBench) -> None:
    """One sentence that says what can be done; another one where the interface is none that the system knows."""
    with SimulatedQx10(SystemClock(), search_port=0) as other:
        silent = other.search_address
    bench, without = make_bench(url=None, search_address=silent), make_bench(url=None, interface="nothing0")

    with pytest.raises(CameraNotFoundError, match=r"check that it is on, or give camera\.url\."), bench.camera:
        pass
    with pytest.raises(CameraNotFoundError, match="nothing0 cannot be used"), without.camera:
        pass


HOSTILE: dict[str, Act] = {
    "drip": drip(OK + b"Content-Length: 99999\r\n\r\n"),
    "silent": lambda connection: connection.recv(1),  # until the other side goes
    "gigabyte": send_a_gigabyte(),
    "redirect": send(b"HTTP/1.1 302 Found\r\nLocation: /silent\r\nContent-Length: 0\r\n\r\n"),
    "digits": send(OK + b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n"),
    "nest": send(OK + b"\r\n" + b"<a>" * 80_000),
}
LONG = Qx10Limits(search_s=120.0, call_s=60.0)
ENOUGH_S = 20.0  # a search that waits for one stranger takes longer


@contextmanager
def network(urls: Iterable[str]) -> Iterator[Qx10Settings]:
    """One on which every question is answered with these locations, in this order, each from its own address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))

        sock.settimeout(0.05)
        over = threading.Event()

        def serve() -> None:
            while not over.is_set():
                with suppress(TimeoutError):
                    _, sender = sock.recvfrom(2048)
                    for url in takewhile(lambda _: not over.is_set(), urls):
                        own = re.match(r"http://(127[\d.]+)", url)
                        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
                            device.bind((own[1] if own else "127.0.0.1", 0))
                            device.sendto(answer(url=url), sender)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield settings_for(sock.getsockname(), limits=LONG)
        finally:
            over.set()
            thread.join()


def look(urls: Iterable[str], listener: Reporter) -> tuple[str, str]:
    """Address and name of the camera that is found among these."""
    clock = SystemClock()
    waiter = Waiter(clock, listener)
    guard = threading.Timer(ENOUGH_S, waiter.stop.set)
    guard.start()
    try:
        with network(urls) as options:
            host, description = first_camera(options, clock, waiter)
    finally:
        guard.cancel()
    return host, description.name


@pytest.mark.parametrize("harm", HOSTILE)
def test_stranger_that_does_harm_does_not_keep_the_camera_from_being_found(
    strangers: Strangers, listener: Reporter, harm: str
) -> None:
    """Though it answers first, and could take longer than the search has time."""
    with SimulatedQx10(SystemClock()) as camera:
        assert look([strangers.url(HOSTILE[harm], harm), camera.url], listener) == ("127.0.0.1", "DSC-QX10")
    assert strangers.asked == {harm: 1}


def test_camera_is_found_behind_a_crowd(strangers: Strangers, listener: Reporter) -> None:
    """A hundred strangers that keep whoever asks, each twice: so many are asked at once, and none twice."""
    crowd = [strangers.url(HOSTILE[harm], f"{harm}-{number}") for number in range(50) for harm in ("silent", "drip")]
    with SimulatedQx10(SystemClock()) as camera:
        assert look([*crowd, *crowd, camera.url], listener) == ("127.0.0.1", "DSC-QX10")
    assert len(strangers.asked) == 100
    assert set(strangers.asked.values()) == {1}
    assert MAX_DESCRIPTIONS // 2 <= strangers.most_threads <= MAX_DESCRIPTIONS


@pytest.mark.parametrize("pages", [count(), range(9)], ids=["a flood without end", "strangers that say nothing"])
def test_stop_ends_the_search_and_all_that_are_asked(
    strangers: Strangers, listener: Reporter, pages: Iterable[int]
) -> None:
    """Also while answers come faster than they are read; nobody is left behind in a call."""
    clock = SystemClock()
    waiter = Waiter(clock, listener)
    threading.Timer(0.5, waiter.stop.set).start()
    with network(strangers.url(HOSTILE["silent"], f"{page}") for page in pages) as options, pytest.raises(Stopped):
        first_camera(options, clock, waiter)
    for thread in threading.enumerate():
        if thread.name == "camera description":
            thread.join(timeout=5)
            assert not thread.is_alive()


@pytest.mark.parametrize("slower", [0, 1])
def test_of_two_cameras_the_one_with_the_lowest_address_is_driven(listener: Listener, slower: int) -> None:
    """Whichever answers first; the log and the flight name the other one, and a configured one is driven instead."""
    clock = SystemClock()
    with ExitStack() as stack:
        cameras = [stack.enter_context(SimulatedQx10(clock, behaviour=QUICK, host=f"127.0.0.{end}")) for end in (2, 10)]
        urls = [camera.url for camera in cameras]
        options = stack.enter_context(network([urls[1 - slower], urls[slower]]))
        with Qx10Camera(options, clock, listener) as camera:
            found = camera.identity.note
        with Qx10Camera(options.model_copy(update={"url": urls[1]}), clock, listener) as camera:
            configured = camera.identity.note

    assert "at 127.0.0.2:" in found
    assert f", of 2 cameras the one with the lowest address; camera.url chooses: {urlsplit(urls[1]).netloc}" in found
    assert any(status.state == "connected" and found in status.reason for status in listener.reports)
    assert "at 127.0.0.10:" in configured
    assert "cameras" not in configured


@pytest.mark.parametrize("url", ["http://[fe80::1%25wlan0]:64321/DmsRmtDesc.xml", "http://0.0.0.0:64321/x", ""])
def test_camera_that_names_a_page_elsewhere_is_one_sentence(listener: Reporter, url: str) -> None:
    """At an IPv6 address, or none: who looks for the camera is told that it answers, and what it names."""
    clock = SystemClock()
    with network([url]) as options:
        quick = options.model_copy(update={"limits": Qx10Limits(search_s=0.5)})
        with pytest.raises(CameraNotFoundError, match=r"^127\.0\.0\.1 answers.*; give camera\.url\.$") as caught:
            first_camera(quick, clock, Waiter(clock, listener))
    assert (url or "no page") in str(caught.value)


def test_nobody_but_strangers_is_one_sentence(strangers: Strangers, listener: Reporter) -> None:
    """What the last one had instead of a description."""
    clock = SystemClock()
    with network([strangers.url(HOSTILE["redirect"])]) as options:
        quick = options.model_copy(update={"limits": Qx10Limits(search_s=0.5)})
        with pytest.raises(CameraNotFoundError, match=r"x: HTTP status 302; check camera\.url\.$"):
            first_camera(quick, clock, Waiter(clock, listener))


def test_machine_that_opens_no_more_files_is_one_sentence(listener: Reporter) -> None:
    """The search is tried again like any other, where the recording had ended."""
    clock = SystemClock()
    with no_more_files(), pytest.raises(CameraNotFoundError, match=r"cannot be looked for .*Too many open files"):
        first_camera(Qx10Settings(driver="qx10"), clock, Waiter(clock, listener))


# Written after the recorded ones: blanks where nobody needs them, and an element without content.
PAGE = """<?xml version="1.0"?>
<root xmlns="urn:schemas-upnp-org:device-1-0"><device><friendlyName> DSC-QX10 </friendlyName>
<UDN>uuid:00000000-0005-0010-8000-0a0b0c0d0e0f</UDN>
<av:X_ScalarWebAPI_DeviceInfo xmlns:av="urn:schemas-sony-com:av"><av:X_ScalarWebAPI_ServiceList>
<av:X_ScalarWebAPI_Service><av:X_ScalarWebAPI_ServiceType>camera</av:X_ScalarWebAPI_ServiceType>
<av:X_ScalarWebAPI_ActionList_URL>http://10.0.0.1:10000/sony</av:X_ScalarWebAPI_ActionList_URL>
<av:X_ScalarWebAPI_AccessType /></av:X_ScalarWebAPI_Service>
<av:X_ScalarWebAPI_Service><av:X_ScalarWebAPI_ServiceType>guide</av:X_ScalarWebAPI_ServiceType>
<av:X_ScalarWebAPI_AccessType /></av:X_ScalarWebAPI_Service>
</av:X_ScalarWebAPI_ServiceList></av:X_ScalarWebAPI_DeviceInfo></device></root>"""


def test_description_says_who_and_where() -> None:
    """The endpoint is the service's URL and its name; a service without URL is left out."""
    description = parse_description(PAGE.encode(), LOCATION)

    assert (description.name, description.serial) == ("DSC-QX10", "0a0b0c0d0e0f")
    assert description.services == {"camera": "http://10.0.0.1:10000/sony/camera"}


def test_name_of_a_megabyte_is_cut() -> None:
    """Who it is stands in each status of the box; no more of it than a sentence holds."""
    assert len(parse_description(PAGE.replace("DSC-QX10", "B" * 900_000).encode(), LOCATION).name) < 200


@pytest.mark.parametrize(
    "page",
    [
        b"",
        b"<html>not closed",
        b"<a>&" + b"e" * 700_000 + b";</a>",
        b"\xff\xd8\xff",
        b"<root/>",
        PAGE.replace("camera</av", "other</av").encode(),
        b'<!DOCTYPE r [<!ENTITY a "b">]>' + PAGE.split("?>")[1].encode(),
        b'<?xml version="1.0" encoding="none-such"?>' + PAGE.split("?>")[1].encode(),
    ],
)
def test_page_that_is_no_description_is_one_sentence(page: bytes) -> None:
    """No XML, a DTD, an unknown encoding, or no camera in it."""
    with pytest.raises(CameraNotFoundError, match=r"^http://10.*check camera\.url\.$") as caught:
        parse_description(page, LOCATION)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
