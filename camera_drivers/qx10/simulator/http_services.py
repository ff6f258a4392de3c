"""The simulated camera's web server: description, calls, pictures, liveview, and the faults that concern their bytes.

Every answer ends its connection, as the camera's do.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from camera_drivers.qx10.simulator.faults import DESCRIPTION, DOWNLOAD, SHOT, STREAM, Mischief
from camera_drivers.qx10.simulator.ledger import Ledger
from camera_drivers.qx10.simulator.liveview_stream import stream
from camera_drivers.qx10.simulator.model import CameraModel, RefusedCallError
from camera_drivers.qx10.simulator.pictures import without_exif
from camera_drivers.qx10.simulator.power import Power
from camera_drivers.qx10.simulator.shot_faults import AFTERWARDS, INSTEAD

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


@dataclass(frozen=True, slots=True)
class Parts:
    """What the server serves."""

    model: CameraModel
    mischief: Mischief
    ledger: Ledger
    power: Power
    address: str


class CameraServer(ThreadingHTTPServer):
    """The server; a client that goes away is nothing to talk about."""

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = 32

    def __init__(self, host: str, port: int) -> None:
        super().__init__((host, port), Handler)
        self.parts: Parts | None = None

    def handle_error(self, request: object, client_address: object) -> None:
        """Nothing: the faults break connections all the time."""


class Handler(BaseHTTPRequestHandler):
    """One request."""

    protocol_version = "HTTP/1.1"
    server: CameraServer

    @property
    def parts(self) -> Parts:
        """What is served."""
        if self.server.parts is None:
            raise RuntimeError("the server was started before it had anything to serve")
        return self.server.parts

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name there
        """Nothing."""

    def do_GET(self) -> None:
        """Description, picture or liveview."""
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
        """A call."""
        if not self._is_there():
            return
        length = int(self.headers.get("Content-Length") or 0)
        question = _question(self.rfile.read(min(length, MAX_BODY_BYTES)))
        if question is None:
            self.answer({"error": [5, "Illegal Request"]})
            return
        method, service = str(question["method"]), self.path.rpartition("/")[2]
        due = self.parts.mischief.due(SHOT) if method == "actTakePicture" else frozenset[str]()
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
        if "huge_description" in self.parts.mischief.due(DESCRIPTION):
            self.send(200, "text/xml", _endless(), length=None)
            return
        services = "".join(_SERVICE % (name, self.parts.address) for name in ("guide", "system", "camera"))
        self.send_bytes(200, "text/xml", (_DESCRIPTION % services).encode())

    def _deliver(self, name: str) -> None:
        jpeg = self.parts.model.picture(name)
        if jpeg is None:
            self.send_bytes(404, "text/html", b"<html>not found</html>")
            return
        due = self.parts.mischief.due(DOWNLOAD)
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
        """All of it; the ledger knows before the last byte goes, so that nobody has a picture that it does not know."""
        yield sent[:-1]
        self.parts.ledger.deliver(name, sent, complete=True, intact=intact)
        yield sent[-1:]

    def _stream(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "image/jpeg")
        self.send_header("Transfer-Encoding", "chunked")
        self.send_header("Connection", "close")
        self.end_headers()
        packets = stream(self.parts.model, lambda: self.parts.mischief.due(STREAM))
        with suppress(OSError):
            for packet in packets:
                self.wfile.write(b"%x\r\n%s\r\n" % (len(packet), packet))
                if not self.parts.power.is_on:
                    break
            self.wfile.write(b"0\r\n\r\n")
        self.close_connection = True

    def cut(self) -> None:
        """End the connection without a word."""
        self.close_connection = True
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def answer(self, document: dict[str, Any], status: int = 200) -> None:
        """Send a JSON document."""
        self.send_bytes(status, "application/json", json.dumps(document).encode())

    def send_bytes(self, status: int, kind: str, body: bytes) -> None:
        """Send an answer that is there as a whole."""
        self.send(status, kind, iter([body]), length=len(body))

    def send(self, status: int, kind: str, blocks: Iterator[bytes], *, length: int | None) -> None:
        """Send an answer in these blocks, with this length announced; None for none."""
        self.close_connection = True
        with suppress(OSError):  # nobody is there to hear of it
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Connection", "close")
            if length is not None:
                self.send_header("Content-Length", str(length))
            self.end_headers()
            for block in blocks:
                self.wfile.write(block)


def _question(body: bytes) -> dict[str, Any] | None:
    """A question as it has to be; None if it is not."""
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
