"""The simulated camera's services: web server, liveview stream, and the answers to a search on the network.

Every answer ends its connection, as the camera's do. Faults that concern bytes happen here.
"""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from camera_drivers.qx10.simulator.faults import DESCRIPTION, DOWNLOAD, SEARCH, SHOT, STREAM, FaultSchedule
from camera_drivers.qx10.simulator.model import CameraModel, RefusedCallError
from camera_drivers.qx10.simulator.pictures import without_exif
from camera_drivers.qx10.simulator.shot_faults import AFTERWARDS, INSTEAD, Parts

RATE_HZ = 15.0
ROUND_BYTES = 128
_JUNK = b"\xff\x01\x00\x00\x00\x00\x00\x00\x24\x35\x68\x79\x00\x10\x00\x00" * 3
_STALL_S = 3600.0  # longer than anybody waits
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
DESCRIPTION_PATH = "/DmsRmtDesc.xml"
MAX_BODY_BYTES = 64 * 1024
GIGABYTE = 2**30
_BLOCK = bytes(64 * 1024)
_DESCRIPTION = """<?xml version="1.0"?>
<root xmlns="urn:schemas-upnp-org:device-1-0"><specVersion><major>1</major><minor>0</minor></specVersion><device>
<deviceType>urn:schemas-upnp-org:device:Basic:1</deviceType><friendlyName>DSC-QX10</friendlyName>
<manufacturer>Sony Corporation</manufacturer><modelName>SonyImagingDevice</modelName>
<UDN>uuid:00000000-0005-0010-8000-020000000010</UDN>
<av:X_ScalarWebAPI_DeviceInfo xmlns:av="urn:schemas-sony-com:av">
<av:X_ScalarWebAPI_Version>1.0</av:X_ScalarWebAPI_Version><av:X_ScalarWebAPI_ServiceList>%s
</av:X_ScalarWebAPI_ServiceList></av:X_ScalarWebAPI_DeviceInfo></device></root>
"""
_SERVICE = """
<av:X_ScalarWebAPI_Service><av:X_ScalarWebAPI_ServiceType>%s</av:X_ScalarWebAPI_ServiceType>
<av:X_ScalarWebAPI_ActionList_URL>%s/sony</av:X_ScalarWebAPI_ActionList_URL>
<av:X_ScalarWebAPI_AccessType /></av:X_ScalarWebAPI_Service>"""


def packet(number: int, timestamp_ms: int, jpeg: bytes) -> bytes:
    """Build a packet with a picture; the payload is padded with junk."""
    payload = jpeg + b"\xa5" * (-len(jpeg) % ROUND_BYTES)
    common = b"\xff\x01" + (number % 65536).to_bytes(2, "big") + (timestamp_ms % 2**32).to_bytes(4, "big")
    sizes = len(payload).to_bytes(3, "big") + b"\x00"
    return common + b"\x24\x35\x68\x79" + sizes + bytes(120) + payload


def information_packet(number: int) -> bytes:
    """Build a packet without a picture, as for face positions."""
    frame = bytes(16)
    head = b"\xff\x02" + (number % 65536).to_bytes(2, "big") + bytes(4) + b"\x24\x35\x68\x79"
    sizes = len(frame).to_bytes(3, "big") + b"\x04"
    return head + sizes + b"\x01\x00\x00\x01\x00\x10" + bytes(114) + frame + bytes(4)


def stream(model: CameraModel, due: Callable[[], frozenset[str]]) -> Iterator[bytes]:
    """Send packets for as long as the client takes them."""
    number = 0
    while True:
        faults = due()
        if "liveview_restart" in faults:
            return
        if "liveview_stall" in faults:
            _stall(model)
            return
        if "liveview_junk" in faults:
            yield _JUNK + information_packet(number)
        yield packet(number, round(number * 1000 / RATE_HZ), model.live_picture())
        number += 1
        time.sleep(1 / RATE_HZ)


def _stall(model: CameraModel) -> None:
    for _ in range(round(_STALL_S * RATE_HZ)):
        time.sleep(1 / RATE_HZ)
        if not model.liveview:
            return


class SearchAnswers(threading.Thread):
    """Answers searches until it is closed.

    Parameters
    ----------
    host, port
        Where to listen; port 0 for any.
    group
        The multicast group to join on this host's interface; None for none.
    """

    def __init__(
        self, location: str, fault_schedule: FaultSchedule, *, host: str, port: int, group: str | None = None
    ) -> None:
        super().__init__(name="simulated search", daemon=True)
        self._location = location
        self._schedule = fault_schedule
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
        """The address that it listens on."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def run(self) -> None:
        """Answer searches until closed."""
        while not self._closed.is_set():
            with suppress(TimeoutError):
                question, sender = self._socket.recvfrom(2048)
                self._answer(question.decode("latin-1"), sender)

    def close(self) -> None:
        """Stop answering."""
        self._closed.set()
        self.join()
        self._socket.close()

    def _answer(self, question: str, sender: tuple[str, int]) -> None:
        # A question without an empty line at its end is not answered; some cameras are like that.
        if not question.startswith("M-SEARCH ") or SERVICE not in question or not question.endswith("\r\n\r\n"):
            return
        if "stranger" in self._schedule.due(SEARCH):
            for answer in _STRANGERS:
                self._socket.sendto(answer.encode("latin-1"), sender)
        self._socket.sendto(_ANSWER.format(location=self._location, service=SERVICE).encode(), sender)


class CameraServer(ThreadingHTTPServer):
    """The web server; clients may go away at any time."""

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = 32

    def __init__(self, host: str, port: int) -> None:
        super().__init__((host, port), Handler)
        self.parts: Parts | None = None

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore it: the faults keep breaking connections."""


class Handler(BaseHTTPRequestHandler):
    """Handles one request."""

    protocol_version = "HTTP/1.1"
    server: CameraServer

    @property
    def parts(self) -> Parts:
        """The parts of the camera."""
        if self.server.parts is None:
            raise RuntimeError("the server was started before it had anything to serve")
        return self.server.parts

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name there
        """Log nothing."""

    def do_GET(self) -> None:
        """Serve the description, a picture or the liveview."""
        if not self._is_there():
            return
        path = urlsplit(self.path).path
        if path == DESCRIPTION_PATH:
            self._describe()
        elif path.startswith("/liveview"):
            self._stream()
        else:
            self._deliver(path.lstrip("/"))

    def do_POST(self) -> None:
        """Answer a call."""
        if not self._is_there():
            return
        length = int(self.headers.get("Content-Length") or 0)
        question = _question(self.rfile.read(min(length, MAX_BODY_BYTES)))
        if question is None:
            self.answer({"error": [5, "Illegal Request"]})
            return
        method, service = str(question["method"]), self.path.rpartition("/")[2]
        due = self.parts.fault_schedule.due(SHOT) if method == "actTakePicture" else frozenset[str]()
        for name in due:
            if name in INSTEAD:
                INSTEAD[name](self, question)
                return
        answer = {"id": question["id"], **self._called(service, method, question)}
        for name in due:
            if name in AFTERWARDS:
                AFTERWARDS[name](self, answer)
                return
        self.answer(answer)

    def _is_there(self) -> bool:
        self.parts.power.wait_while_silent()
        if not self.parts.power.is_on:
            self.cut()
        return self.parts.power.is_on

    def _called(self, service: str, method: str, question: dict[str, Any]) -> dict[str, Any]:
        try:
            result = self.parts.model.call(service, method, question["params"], question.get("version"))
        except RefusedCallError as refusal:
            return {"error": [refusal.code, method]}
        return {"result": result}

    def _describe(self) -> None:
        if "huge_description" in self.parts.fault_schedule.due(DESCRIPTION):
            self.send(200, "text/xml", _endless(), length=None)
            return
        services = "".join(_SERVICE % (name, self.parts.address) for name in ("guide", "system", "camera"))
        self.send_bytes(200, "text/xml", (_DESCRIPTION % services).encode())

    def _deliver(self, name: str) -> None:
        jpeg = self.parts.model.picture(name)
        if jpeg is None:
            self.send_bytes(404, "text/html", b"<html>not found</html>")
            return
        due = self.parts.fault_schedule.due(DOWNLOAD)
        sent, length, intact = jpeg, True, True
        if "refused_download" in due:
            self.send_bytes(404, "text/html", b"<html>not found</html>")
            return
        if "huge_picture" in due:
            self.send(200, "image/jpeg", _endless(), length=None)
            return
        if "without_exif" in due:
            sent = without_exif(jpeg)
        if "cut_short" in due:
            sent, intact = jpeg[: len(jpeg) * 2 // 3], False
        if "damaged" in due:
            sent, intact = jpeg[:2] + bytes(len(jpeg) // 2) + jpeg[2 + len(jpeg) // 2 :], False
        if "without_length" in due:
            length = False
        blocks = self._half(name, sent) if "drop_mid_download" in due else self._whole(name, sent, intact=intact)
        self.send(200, "image/jpeg", blocks, length=len(sent) if length else None)

    def _half(self, name: str, sent: bytes) -> Iterator[bytes]:
        yield sent[: len(sent) // 2]
        self.parts.ledger.deliver(name, sent, complete=False, intact=True)

    def _whole(self, name: str, sent: bytes, *, intact: bool) -> Iterator[bytes]:
        """Send all of it; the ledger is updated before the last byte, so that it contains every delivered picture."""
        yield sent[:-1]
        self.parts.ledger.deliver(name, sent, complete=True, intact=intact)
        yield sent[-1:]

    def _stream(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "image/jpeg")
        self.send_header("Transfer-Encoding", "chunked")
        self.send_header("Connection", "close")
        self.end_headers()
        packets = stream(self.parts.model, lambda: self.parts.fault_schedule.due(STREAM))
        with suppress(OSError):
            for packet in packets:
                self.wfile.write(b"%x\r\n%s\r\n" % (len(packet), packet))
                if not self.parts.power.is_on:
                    break
            self.wfile.write(b"0\r\n\r\n")
        self.close_connection = True

    def cut(self) -> None:
        """Close the connection without an answer."""
        self.close_connection = True
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def answer(self, document: dict[str, Any], status: int = 200) -> None:
        """Send a JSON document."""
        self.send_bytes(status, "application/json", json.dumps(document).encode())

    def send_bytes(self, status: int, kind: str, body: bytes) -> None:
        """Send a whole body."""
        self.send(status, kind, iter([body]), length=len(body))

    def send(self, status: int, kind: str, blocks: Iterator[bytes], *, length: int | None) -> None:
        """Send an answer in these blocks, with this length announced; None for none."""
        self.close_connection = True
        with suppress(OSError):  # the client is gone
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Connection", "close")
            if length is not None:
                self.send_header("Content-Length", str(length))
            self.end_headers()
            for block in blocks:
                self.wfile.write(block)


def _question(body: bytes) -> dict[str, Any] | None:
    """Parse a call; None if it is malformed."""
    try:
        question = json.loads(body)
    except ValueError:
        return None
    match question:
        case {"method": str(), "params": list(), "id": int(number)} if 1 <= number <= 2**31 - 1:
            return dict(question)
    return None


def _endless() -> Iterator[bytes]:
    for _ in range(GIGABYTE // len(_BLOCK)):
        yield _BLOCK
