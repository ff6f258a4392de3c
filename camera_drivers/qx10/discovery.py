"""Find the camera by SSDP: a multicast search on one interface, with answers that are not trusted.

An answer counts if it names Sony's service and a page at the address that it came from, in one of the box's own
networks. Its sender may still be forged, so only a URL such as a camera gives is fetched, without query and user name,
by which a forger could make the box command another device.

    answer ──believable──▶ asked, side by side ──a camera's description──▶ found
                             │ (at most MAX_DESCRIPTIONS; the system's buffer holds or drops further answers)
                             └─ no camera, silent, too slow: its place is free for the next answer

A slow device does not delay the others: it keeps its place for as long as a call may take, or, while all places are
taken, for CROWDED_S. Every camera has SEARCH_AGAIN_S to answer; of several, the one with the lowest address is taken,
whichever was faster.

A camera's description is an XML page that says who it is: UPnP's device description with Sony's `av` part, in which
`X_ScalarWebAPI_Service` names each service and the URL that its calls go below. It comes from an unknown sender, so its
size is limited and it may not declare a DTD.
"""

from __future__ import annotations

import socket
import struct
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from ipaddress import ip_address, ip_network
from itertools import islice
from urllib.parse import urlsplit
from xml.etree.ElementTree import Element, ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraNotFoundError
from camera_drivers.qx10.addresses import BadUrlError, host_of
from camera_drivers.qx10.link import Exchange
from camera_drivers.qx10.options import Qx10Limits, Qx10Settings
from camera_drivers.thresholds import (
    CROWDED_S,
    LOOK_S,
    MAX_ANSWER_BYTES,
    MAX_DATAGRAM_BYTES,
    MAX_DATAGRAMS,
    MAX_DESCRIPTIONS,
    MAX_KNOWN_URLS,
    SEARCH_AGAIN_S,
)
from camera_drivers.waiting import Job, Waiter, begin
from flight_file.frame import NS_PER_S
from flight_file.untrusted import shown

_UPNP = "{urn:schemas-upnp-org:device-1-0}"
_AV = "{urn:schemas-sony-com:av}"
_OK = 200
SERVICE = "urn:schemas-sony-com:service:ScalarWebAPI:1"
NETWORKS = tuple(map(ip_network, ("127.0.0.0/8", "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16")))


@dataclass(frozen=True, slots=True)
class Description:
    """Identity of a camera, and the addresses of its services.

    Attributes
    ----------
    services
        URL of each service by its name, as the camera gives it.
    others
        Addresses of the other cameras that answered the search.
    """

    name: str
    serial: str
    services: Mapping[str, str]
    others: tuple[str, ...] = ()


def fetch_description(exchange: Exchange, url: str) -> Description:
    """Fetch and parse a description, and close the exchange.

    Raises
    ------
    CameraNotFoundError
        The page does not describe a camera that can be operated.
    CameraError
        The device cannot be reached, or does not answer completely.
    """
    with exchange:
        answer = exchange.fetch("description", "GET", url, max_bytes=MAX_ANSWER_BYTES)
    if answer.status != _OK:
        raise CameraNotFoundError(f"{url}: HTTP status {answer.status}; check camera.url.")
    return parse_description(answer.body, url)


def parse_description(xml: bytes, url: str) -> Description:
    """Parse a description; raises CameraNotFoundError, with `url` in its message."""
    try:
        root = fromstring(xml, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise CameraNotFoundError(f"{url}: the answer is not XML ({shown(str(error))}); check camera.url.") from error
    services = {}
    for service in root.iter(f"{_AV}X_ScalarWebAPI_Service"):
        name, base = (
            _text(service, f"{_AV}X_ScalarWebAPI_ServiceType"),
            _text(service, f"{_AV}X_ScalarWebAPI_ActionList_URL"),
        )
        if name and base:
            services[name] = f"{base.rstrip('/')}/{name}"
    if "camera" not in services:
        raise CameraNotFoundError(f"{url}: the device there offers no service `camera`; check camera.url.")
    device = root.find(f"{_UPNP}device")
    if device is None:
        return Description("", "", services)
    name, serial = _text(device, f"{_UPNP}friendlyName"), _serial(_text(device, f"{_UPNP}UDN"))
    return Description(shown(name), shown(serial), services)


def _text(element: Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()


def _serial(udn: str) -> str:
    return udn.rpartition("-")[2]  # the last group is the camera's MAC address


def first_camera(options: Qx10Settings, clock: Clock, waiter: Waiter) -> tuple[str, Description]:
    """Search the network; return address and description of the device that describes itself as a camera.

    Of several, it is the one with the lowest address.

    Raises
    ------
    CameraNotFoundError
        There is none, or the interface cannot be used.
    CameraError
        What is there does not answer.
    Stopped
        Stopping was asked for.
    """
    question = _question(*options.search_address)
    inquiries = _Inquiries(options.limits, clock)
    with _socket(options.interface) as sock:
        end_ns = clock.read().monotonic_ns + round(options.limits.search_s * NS_PER_S)
        ask_ns = 0
        try:
            while (now_ns := clock.read().monotonic_ns) < end_ns:
                if now_ns >= ask_ns:
                    if inquiries.cameras:
                        break
                    _ask(sock, question, options)
                    ask_ns = now_ns + round(SEARCH_AGAIN_S * NS_PER_S)
                inquiries.begin(_datagrams(sock))
                waiter.pause("looking for the camera", LOOK_S)
                inquiries.look()
        finally:
            inquiries.give_up()
    return inquiries.first()


def location(answer: bytes, sender: str) -> str | None:
    """Extract the address of a description from a search answer; None if it is not credible."""
    url = _claimed_location(answer) or ""
    try:
        own = host_of(url) == sender
    except BadUrlError:
        return None
    parts = urlsplit(url)
    plain = not parts.query and not parts.username
    return url if own and plain and any(ip_address(sender) in network for network in NETWORKS) else None


def _claimed_location(answer: bytes) -> str | None:
    """Return what an answer names as the address of a camera's description; None if it is no answer of a camera."""
    lines = answer.decode("latin-1").split("\r\n")
    headers = {name.strip().upper(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
    if not lines[0].startswith("HTTP/1.") or " 200" not in lines[0] or headers.get("ST") != SERVICE:
        return None
    return headers.get("LOCATION", "")


@dataclass(frozen=True, slots=True)
class _Inquiry:
    """A pending request for a description."""

    host: str
    url: str
    exchange: Exchange
    job: Job[Description]
    began_ns: int


class _Inquiries:
    """Concurrent requests for descriptions, each URL once.

    Attributes
    ----------
    cameras
        Those found so far: address and description by URL.
    """

    def __init__(self, limits: Qx10Limits, clock: Clock) -> None:
        self._limits = limits
        self._clock = clock
        self._running: list[_Inquiry] = []
        self._asked: deque[str] = deque(maxlen=MAX_KNOWN_URLS)
        self._failure: CameraError | None = None
        self.cameras: dict[str, tuple[str, Description]] = {}

    def begin(self, datagrams: Iterator[tuple[bytes, str]]) -> None:
        """Start requests for as many candidates as there are places, and ignore the others."""
        left = islice(datagrams, MAX_DATAGRAMS)
        while len(self._running) < MAX_DESCRIPTIONS and (datagram := next(left, None)) is not None:
            url = location(*datagram)
            if url is None:
                self._refuse(*datagram)
            elif url not in self._asked:
                self._asked.append(url)
                self._begin(url)

    def first(self) -> tuple[str, Description]:
        """Return the camera with the lowest address; raises CameraError if there is none."""
        if not self.cameras:
            raise self._failure or CameraNotFoundError(
                "No camera answers on the network; check that it is on, or give camera.url."
            )
        urls = sorted(self.cameras, key=lambda url: (ip_address(self.cameras[url][0]), url))
        host, description = self.cameras[urls[0]]
        return host, replace(description, others=tuple(urlsplit(url).netloc for url in urls[1:]))

    def look(self) -> None:
        """Take in who has answered; devices that answered or timed out make room for others."""
        limit_s = self._limits.call_s if len(self._running) < MAX_DESCRIPTIONS else CROWDED_S
        oldest_ns = self._clock.read().monotonic_ns - round(limit_s * NS_PER_S)
        for inquiry in tuple(self._running):
            if inquiry.job.done.is_set():
                self._running.remove(inquiry)
                try:
                    self.cameras[inquiry.url] = inquiry.host, inquiry.job.outcome()
                except CameraError as error:
                    self._failure = error
            elif inquiry.began_ns <= oldest_ns:
                inquiry.exchange.abort()  # its place is free when its thread has noticed

    def give_up(self) -> None:
        """Abort the pending requests."""
        for inquiry in self._running:
            inquiry.exchange.abort()

    def _refuse(self, answer: bytes, sender: str) -> None:
        url = _claimed_location(answer)
        if url is not None and self._failure is None:
            self._failure = CameraNotFoundError(
                f"{sender} answers as a camera does, but names {shown(url) or 'no page'}, and only an http page at its"
                " own IPv4 address, on a private network, is believed; give camera.url."
            )

    def _begin(self, url: str) -> None:
        host = host_of(url)
        exchange = Exchange(host, connect_s=self._limits.connect_s, quiet_s=2 * self._limits.call_s)
        job = Job("description", partial(fetch_description, exchange, url))
        begin(job, "description")
        self._running.append(_Inquiry(host, url, exchange, job, self._clock.read().monotonic_ns))


def _question(host: str, port: int) -> bytes:
    lines = ["M-SEARCH * HTTP/1.1", f"HOST: {host}:{port}", 'MAN: "ssdp:discover"', "MX: 1", f"ST: {SERVICE}", "", ""]
    return "\r\n".join(lines).encode("ascii")


def _socket(interface: str | None) -> socket.socket:
    try:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:  # the system has no file or no memory left for it
        raise _not_looked_for(interface, error) from error
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
    if interface is None:
        return sock
    try:
        index = socket.if_nametoindex(interface)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, struct.pack("4s4si", bytes(4), bytes(4), index))
    except OSError as error:
        sock.close()
        raise CameraNotFoundError(
            f"camera.interface: {interface} cannot be used ({error.strerror}); check its name and that it is up."
        ) from error
    with suppress(PermissionError):  # old kernels require a privilege; then the answers' own addresses must do
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode() + b"\0")
    return sock


def _ask(sock: socket.socket, question: bytes, options: Qx10Settings) -> None:
    try:
        sock.sendto(question, options.search_address)
    except OSError as error:
        raise _not_looked_for(options.interface, error) from error


def _not_looked_for(interface: str | None, error: OSError) -> CameraNotFoundError:
    where = interface or "any interface"
    return CameraNotFoundError(f"The camera cannot be looked for on {where} ({error.strerror}); check the network.")


def _datagrams(sock: socket.socket) -> Iterator[tuple[bytes, str]]:
    with suppress(OSError):  # no more for now, or a notice that the port is closed
        while True:
            data, (sender, *_) = sock.recvfrom(MAX_DATAGRAM_BYTES)
            yield data, sender
