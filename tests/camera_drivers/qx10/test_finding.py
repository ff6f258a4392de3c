"""Finding the camera: whom to believe, and what a description must be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_drivers.errors import CameraNotFoundError
from camera_drivers.qx10.description import parse_description
from camera_drivers.qx10.discovery import location
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from recorder.clock import SystemClock

MakeBench = Callable[..., Any]

URN = "urn:schemas-sony-com:service:ScalarWebAPI:1"
CAMERA = "10.0.0.1"
LOCATION = "http://10.0.0.1:64321/DmsRmtDesc.xml"


def answer(status: str = "HTTP/1.1 200 OK", service: str = URN, url: str = LOCATION) -> bytes:
    """As the camera answers a search."""
    return f"{status}\r\nEXT: \r\nLOCATION: {url}\r\nServer: x\r\nst: {service}\r\n\r\n".encode("latin-1")


def test_answer_of_the_camera_names_its_description() -> None:
    """Headers in any case, and one without a value."""
    assert location(answer(), CAMERA) == LOCATION


@pytest.mark.parametrize(
    "strange",
    [
        answer("HTTP/1.1 404 Not Found"),
        answer("NOTIFY * HTTP/1.1"),
        answer(service="upnp:rootdevice"),
        answer(url="http://192.0.2.7:64321/DmsRmtDesc.xml"),
        answer(url="http://0.0.0.0:64321/DmsRmtDesc.xml"),
        answer(url="https://10.0.0.1/x"),
        answer(url=""),
        b"",
    ],
)
def test_answer_of_a_stranger_is_ignored(strange: bytes) -> None:
    """Another service, another address than its sender's, or no answer at all."""
    assert location(strange, CAMERA) is None


@given(data=st.binary(max_size=200))
def test_any_datagram_may_come(data: bytes) -> None:
    """Nothing is raised."""
    assert location(data, CAMERA) is None


def test_camera_is_found_among_strangers(make_bench: MakeBench) -> None:
    """Without a URL: it is asked for on the network, and strangers that answer first are passed over."""
    bench = make_bench("stranger@1")
    camera = make_bench(url=None, search_address=bench.simulated.search_address)

    assert len(camera.take(1)) == 1
    assert len(bench.simulated.ledger.taken) == 1


def test_nobody_answers(make_bench: MakeBench) -> None:
    """One sentence that says what can be done."""
    with SimulatedQx10(SystemClock(), search_port=0) as other:
        silent = other.search_address
    bench = make_bench(url=None, search_address=silent)

    with pytest.raises(CameraNotFoundError, match=r"check that it is on, or give camera\.url\."), bench.camera:
        pass


def test_interface_that_is_not_there(make_bench: MakeBench) -> None:
    """A name that the system does not know."""
    bench = make_bench(url=None, interface="nothing0")

    with pytest.raises(CameraNotFoundError, match="nothing0 cannot be used"), bench.camera:
        pass


def test_camera_is_found_on_the_wanted_interface(make_bench: MakeBench) -> None:
    """The question goes out where it shall."""
    bench = make_bench()
    camera = make_bench(url=None, interface="lo", search_address=bench.simulated.search_address)

    assert len(camera.take(1)) == 1


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


@pytest.mark.parametrize(
    "page",
    [
        b"",
        b"<html>not closed",
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
