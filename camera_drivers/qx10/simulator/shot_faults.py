"""What the simulated camera does wrong when asked for a picture: instead of taking it, or instead of the answer."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from camera_drivers.qx10.simulator.http_services import Handler

_DRIP_S = 0.05


def _refuse(code: int) -> Callable[[Handler, dict[str, Any]], None]:
    return lambda handler, question: handler.answer({"id": question["id"], "error": [code, question["method"]]})


def _http_500(handler: Handler, _question: dict[str, Any]) -> None:
    handler.send_bytes(500, "text/html", b"<html>Internal Server Error</html>")


def _http_503(handler: Handler, _question: dict[str, Any]) -> None:
    handler.answer({"error": [503, "Service Unavailable"]}, 503)


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


INSTEAD: dict[str, Callable[[Handler, dict[str, Any]], None]] = {
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
        handler.send_bytes(200, "application/json", body)

    return send


def _wrong_id(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.hide_last()
    handler.answer(answer | {"id": answer["id"] + 1})


def _delayed(handler: Handler, answer: dict[str, Any]) -> None:
    time.sleep(handler.parts.model.behaviour.delay_s)
    handler.answer(answer)


def _dripping(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.hide_last()
    body = json.dumps(answer).encode()

    def drops() -> Iterator[bytes]:
        for byte in body:
            time.sleep(_DRIP_S)
            yield bytes([byte])

    handler.send(200, "application/json", drops(), length=len(body))


def _not_finished(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.model.stay_unfinished()
    handler.answer({"id": answer["id"], "error": [40403, "actTakePicture"]})


def _at_host(host: str) -> Callable[[Handler, dict[str, Any]], None]:
    def send(handler: Handler, answer: dict[str, Any]) -> None:
        own = urlsplit(handler.parts.address)
        text = json.dumps(answer).replace(f"//{own.hostname}:", f"//{host}:")
        handler.answer(json.loads(text))

    return send


def _overheat(handler: Handler, answer: dict[str, Any]) -> None:
    handler.parts.power.overheat()
    handler.answer(answer)


AFTERWARDS: dict[str, Callable[[Handler, dict[str, Any]], None]] = {
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
