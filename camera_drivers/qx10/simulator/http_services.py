"""The simulated camera's web server: description, calls, pictures, liveview, and the faults that concern their bytes.

Every answer ends its connection, as the camera's do.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
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

DESCRIPTION_PATH = "/DmsRmtDesc.xml"
MAX_BODY_BYTES = 64 * 1024
GIGABYTE = 2**30

_DRIP_S = 0.05
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
        self.parts.power.wait_while_silent()
        path = urlsplit(self.path).path
        if path == DESCRIPTION_PATH:
            self._describe()
        elif path.startswith("/liveview"):
            self._stream()
        else:
            self._deliver(path.lstrip("/"))

    def do_POST(self) -> None:
        """A call."""
        self.parts.power.wait_while_silent()
        length = int(self.headers.get("Content-Length") or 0)
        question = _question(self.rfile.read(min(length, MAX_BODY_BYTES)))
        if question is None:
            self._answer({"error": [5, "Illegal Request"]})
            return
        method, service = str(question["method"]), self.path.rpartition("/")[2]
        due = self.parts.mischief.due(SHOT) if method == "actTakePicture" else frozenset[str]()
        for name in due:
            if name in _INSTEAD:
                _INSTEAD[name](self, question)
                return
        answer = {"id": question["id"], **self._called(service, method, question)}
        for name in due:
            if name in _AFTERWARDS:
                _AFTERWARDS[name](self, answer)
                return
        self._answer(answer)

    def _called(self, service: str, method: str, question: dict[str, Any]) -> dict[str, Any]:
        try:
            result = self.parts.model.call(service, method, question["params"], question.get("version"))
        except RefusedCallError as refusal:
            return {"error": [refusal.code, method]}
        return {"result": result}

    def _describe(self) -> None:
        if "huge_description" in self.parts.mischief.due(DESCRIPTION):
            self._send(200, "text/xml", _endless(), length=None)
            return
        services = "".join(_SERVICE % (name, self.parts.address) for name in ("guide", "system", "camera"))
        self._send_bytes(200, "text/xml", (_DESCRIPTION % services).encode())

    def _deliver(self, name: str) -> None:
        jpeg = self.parts.model.picture(name)
        if jpeg is None:
            self._send_bytes(404, "text/html", b"<html>not found</html>")
            return
        due = self.parts.mischief.due(DOWNLOAD)
        sent, length, intact = jpeg, True, True
        if "refused_download" in due:
            self._send_bytes(404, "text/html", b"<html>not found</html>")
            return
        if "huge_picture" in due:
            self._send(200, "image/jpeg", _endless(), length=None)
            return
        if "without_exif" in due:
            sent = without_exif(jpeg)
        if "cut_short" in due:
            sent, intact = jpeg[: len(jpeg) * 2 // 3], False
        if "damaged" in due:
            sent, intact = jpeg[:2] + bytes(len(jpeg) // 2) + jpeg[2 + len(jpeg) // 2 :], False
        if "without_length" in due:
            length = False
        dropped = "drop_mid_download" in due
        blocks = iter([sent[: len(sent) // 2]] if dropped else [sent])
        complete = self._send(200, "image/jpeg", blocks, length=len(sent) if length else None)
        self.parts.ledger.deliver(name, sent, complete=complete and not dropped, intact=intact)

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

    def _answer(self, document: dict[str, Any], status: int = 200) -> None:
        self._send_bytes(status, "application/json", json.dumps(document).encode())

    def _send_bytes(self, status: int, kind: str, body: bytes) -> None:
        self._send(status, kind, iter([body]), length=len(body))

    def _send(self, status: int, kind: str, blocks: Iterator[bytes], *, length: int | None) -> bool:
        """Send an answer; says whether all of it went out."""
        self.close_connection = True
        try:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Connection", "close")
            if length is not None:
                self.send_header("Content-Length", str(length))
            self.end_headers()
            for block in blocks:
                self.wfile.write(block)
            self.wfile.flush()
        except OSError:
            return False
        return True


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


def _refuse(code: int) -> Callable[[Handler, dict[str, Any]], None]:
    return lambda handler, question: handler._answer({"id": question["id"], "error": [code, question["method"]]})  # noqa: SLF001 - one idea


def _http_500(handler: Handler, _question: dict[str, Any]) -> None:
    handler._send_bytes(500, "text/html", b"<html>Internal Server Error</html>")  # noqa: SLF001 - one idea


def _http_503(handler: Handler, _question: dict[str, Any]) -> None:
    handler._answer({"error": [503, "Service Unavailable"]}, 503)  # noqa: SLF001 - one idea


def _reboot(handler: Handler, _question: dict[str, Any]) -> None:
    handler.parts.power.reboot()
    handler.cut()


def _another_clock(handler: Handler, question: dict[str, Any]) -> None:
    handler.parts.model.turn_clock(-5 * 365 * 86400)
    _reboot(handler, question)


def _silent(handler: Handler, _question: dict[str, Any]) -> None:
    handler.parts.power.fall_silent()
    handler.parts.power.wait_while_silent()
    handler.cut()


_INSTEAD: dict[str, Callable[[Handler, dict[str, Any]], None]] = {
    "http_500": _http_500,
    "http_503": _http_503,
    "error_1": _refuse(1),
    "error_403": _refuse(403),
    "error_40400": _refuse(40400),
    "error_40401": _refuse(40401),
    "reboot": _reboot,
    "another_clock": _another_clock,
    "silent": _silent,
}
"""Instead of taking a picture."""


def _lost_answer(handler: Handler, _answer: dict[str, Any]) -> None:
    handler.parts.model.hide_last()
    handler.cut()


def _useless(body: bytes) -> Callable[[Handler, dict[str, Any]], None]:
    def send(handler: Handler, _answer: dict[str, Any]) -> None:
        handler.parts.model.hide_last()
        handler._send_bytes(200, "application/json", body)  # noqa: SLF001 - one idea

    return send


def _wrong_id(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.hide_last()
    handler._answer(answer | {"id": answer["id"] + 1})  # noqa: SLF001 - one idea


def _delayed(handler: Handler, answer: dict[str, Any]) -> None:
    time.sleep(handler.parts.model.behaviour.delay_s)
    handler._answer(answer)  # noqa: SLF001 - one idea


def _dripping(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.hide_last()
    body = json.dumps(answer).encode()

    def drops() -> Iterator[bytes]:
        for byte in body:
            time.sleep(_DRIP_S)
            yield bytes([byte])

    handler._send(200, "application/json", drops(), length=len(body))  # noqa: SLF001 - one idea


def _not_finished(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.stay_unfinished()
    handler._answer({"id": answer["id"], "error": [40403, "actTakePicture"]})  # noqa: SLF001 - one idea


def _at_host(host: str) -> Callable[[Handler, dict[str, Any]], None]:
    def send(handler: Handler, answer: dict[str, Any]) -> None:
        own = urlsplit(handler.parts.address)
        text = json.dumps(answer).replace(f"//{own.hostname}:", f"//{host}:")
        handler._answer(json.loads(text))  # noqa: SLF001 - one idea

    return send


def _overheat(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.power.overheat()
    handler._answer(answer)  # noqa: SLF001 - one idea


_AFTERWARDS: dict[str, Callable[[Handler, dict[str, Any]], None]] = {
    "lost_answer": _lost_answer,
    "empty_answer": _useless(b""),
    "not_json": _useless(b"<html>it works</html>"),
    "wrong_id": _wrong_id,
    "delayed": _delayed,
    "dripping": _dripping,
    "error_40403": _not_finished,
    "zero_host": _at_host("0.0.0.0"),  # noqa: S104 - nobody listens there
    "foreign_host": _at_host("192.0.2.7"),
    "overheat": _overheat,
}
"""Instead of the answer, when the picture is taken."""
