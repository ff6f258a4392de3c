"""The simulated camera's answers to a search on the network, and those of strangers."""

from __future__ import annotations

import socket
import struct
import threading
from contextlib import suppress

from camera_drivers.qx10.simulator.faults import SEARCH, Mischief

SERVICE = "urn:schemas-sony-com:service:ScalarWebAPI:1"
GROUP, PORT = "239.255.255.250", 1900

_LOOK_S = 0.1
_ANSWER = (
    "HTTP/1.1 200 OK\r\nCACHE-CONTROL: max-age=1800\r\nEXT: \r\nLOCATION: {location}\r\n"
    "SERVER: UPnP/1.0 SonyImagingDevice/1.0\r\nST: {service}\r\nUSN: uuid:1::{service}\r\n\r\n"
)
_STRANGERS = (
    _ANSWER.format(location="http://192.0.2.7:64321/DmsRmtDesc.xml", service=SERVICE),
    _ANSWER.format(location="http://127.0.0.1:9/router.xml", service="upnp:rootdevice"),
    "HTTP/1.1 404 Not Found\r\n\r\n",
    "\x00\xff garbage",
)


class SearchAnswers(threading.Thread):
    """Answers searches until it is closed.

    Parameters
    ----------
    host, port
        Where to listen; port 0 for any.
    group
        The multicast group to join on this host's interface; None for none.
    """

    def __init__(self, location: str, mischief: Mischief, *, host: str, port: int, group: str | None = None) -> None:
        super().__init__(name="simulated search", daemon=True)
        self._location = location
        self._mischief = mischief
        self._closed = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind((group or host, port))
        if group is not None:
            membership = struct.pack("4s4s", socket.inet_aton(group), socket.inet_aton(host))
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        self._socket.settimeout(_LOOK_S)

    @property
    def address(self) -> tuple[str, int]:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def run(self) -> None:
        """Answer."""
        while not self._closed.is_set():
            with suppress(TimeoutError):
                question, sender = self._socket.recvfrom(2048)
                self._answer(question.decode("latin-1"), sender)

    def close(self) -> None:
        """No answers any more."""
        self._closed.set()
        self.join()
        self._socket.close()

    def _answer(self, question: str, sender: tuple[str, int]) -> None:
        # A question without an empty line at its end is not answered; some cameras are like that.
        if not question.startswith("M-SEARCH ") or SERVICE not in question or not question.endswith("\r\n\r\n"):
            return
        if "stranger" in self._mischief.due(SEARCH):
            for answer in _STRANGERS:
                self._socket.sendto(answer.encode("latin-1"), sender)
        self._socket.sendto(_ANSWER.format(location=self._location, service=SERVICE).encode(), sender)
