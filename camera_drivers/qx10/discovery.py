"""Finding the camera by SSDP: a question to everybody on one interface, and answers that nobody has to believe.

An answer counts if it speaks of Sony's service and names a description at the address that it came from. Whether that
is a camera shows in the description. Sony's own answers are believed no more than a stranger's.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import suppress

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraNotFoundError
from camera_drivers.qx10.addresses import BadUrlError, host_of
from camera_drivers.qx10.options import Options
from camera_drivers.qx10.patience import Patience

SERVICE = "urn:schemas-sony-com:service:ScalarWebAPI:1"
REPEAT_NS = 2_000_000_000
MAX_ANSWER_BYTES = 2048

_LOOK_S = 0.05
_NS_PER_S = 1_000_000_000


def search(options: Options, clock: Clock, patience: Patience) -> Iterator[str]:
    """URLs of descriptions, each once, for as long as the search may take.

    Raises
    ------
    CameraNotFoundError
        The interface cannot be used.
    Stopped
        Stopping was asked for.
    """
    host, port = options.search_address
    question = _question(host, port)
    seen: set[str] = set()
    with _socket(options.interface) as sock:
        end_ns = clock.read().monotonic_ns + round(options.limits.search_s * _NS_PER_S)
        ask_ns = 0
        while (now_ns := clock.read().monotonic_ns) < end_ns:
            if now_ns >= ask_ns:
                _ask(sock, question, options)
                ask_ns = now_ns + REPEAT_NS
            for url in _answers(sock):
                if url not in seen:
                    seen.add(url)
                    yield url
            patience.pause("looking for the camera", _LOOK_S)


def location(answer: bytes, sender: str) -> str | None:
    """Where the sender of an answer says its description is; None if that is not to be believed."""
    lines = answer.decode("latin-1").split("\r\n")
    headers = {name.strip().upper(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
    url = headers.get("LOCATION", "")
    try:
        believable = (
            lines[0].startswith("HTTP/1.") and " 200" in lines[0] and headers.get("ST") == SERVICE
        ) and host_of(url) == sender
    except BadUrlError:
        return None
    return url if believable else None


def _question(host: str, port: int) -> bytes:
    lines = ["M-SEARCH * HTTP/1.1", f"HOST: {host}:{port}", 'MAN: "ssdp:discover"', "MX: 1", f"ST: {SERVICE}", "", ""]
    return "\r\n".join(lines).encode("ascii")


def _socket(interface: str | None) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
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
    with suppress(PermissionError):  # old kernels want a privilege for it; then the answers' own addresses must do
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode() + b"\0")
    return sock


def _ask(sock: socket.socket, question: bytes, options: Options) -> None:
    try:
        sock.sendto(question, options.search_address)
    except OSError as error:
        where = options.interface or "any interface"
        raise CameraNotFoundError(
            f"The camera cannot be looked for on {where} ({error.strerror}); check the network."
        ) from error


def _answers(sock: socket.socket) -> Iterator[str]:
    while True:
        try:
            answer, (sender, *_) = sock.recvfrom(MAX_ANSWER_BYTES)
        except OSError:  # no more for now, or a message that nobody listens there
            return
        if url := location(answer, sender):
            yield url
