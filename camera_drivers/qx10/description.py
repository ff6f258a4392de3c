"""The camera's description: an XML page that says who it is and where its services are.

It is UPnP's device description with Sony's `av` part: `X_ScalarWebAPI_Service` names each service and the URL that its
calls go below. It comes from the network before anything is known about who sent it, so its size is limited and it may
not declare a DTD.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element, ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from camera_drivers.errors import CameraNotFoundError
from camera_drivers.qx10.link import Link

MAX_BYTES = 256 * 1024  # real ones are about 3 kB

_UPNP = "{urn:schemas-upnp-org:device-1-0}"
_AV = "{urn:schemas-sony-com:av}"
_OK = 200


@dataclass(frozen=True, slots=True)
class Description:
    """Who a camera is and where its services are.

    Attributes
    ----------
    services
        URL of each service by its name, as the camera gives it.
    """

    name: str
    serial: str
    services: Mapping[str, str]


def fetch_description(link: Link, url: str) -> Description:
    """Get and read a description.

    Raises
    ------
    CameraNotFoundError
        What is there is no description of a camera that can be operated.
    CameraSilentError
        Nothing is there.
    """
    answer = link.get("description", url, max_bytes=MAX_BYTES, limit_s=link.limits.call_s)
    if answer.status != _OK:
        raise CameraNotFoundError(f"{url}: HTTP status {answer.status}; check camera.url.")
    return parse_description(answer.body, url)


def parse_description(xml: bytes, url: str) -> Description:
    """Read a description; raises CameraNotFoundError, with `url` in its message."""
    try:
        root = fromstring(xml, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise CameraNotFoundError(f"{url}: what is there is no XML ({error}); check camera.url.") from error
    services = {}
    for service in root.iter(f"{_AV}X_ScalarWebAPI_Service"):
        name, base = (
            _text(service, f"{_AV}X_ScalarWebAPI_ServiceType"),
            _text(service, f"{_AV}X_ScalarWebAPI_ActionList_URL"),
        )
        if name and base:
            services[name] = f"{base.rstrip('/')}/{name}"
    if "camera" not in services:
        raise CameraNotFoundError(f"{url}: what is there offers no service `camera`; check camera.url.")
    device = root.find(f"{_UPNP}device")
    if device is None:
        return Description("", "", services)
    return Description(_text(device, f"{_UPNP}friendlyName"), _serial(_text(device, f"{_UPNP}UDN")), services)


def _text(element: Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()


def _serial(udn: str) -> str:
    return udn.rpartition("-")[2]  # the last group is the camera's MAC address
