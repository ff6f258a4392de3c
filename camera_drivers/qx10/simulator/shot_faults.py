"""What the simulated camera does wrong instead of taking a picture or answering: reboot, hang, overheat, fail."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol
from urllib.parse import urlsplit

from camera_drivers.clock import Clock
from camera_drivers.qx10.simulator.faults import FaultSchedule
from camera_drivers.qx10.simulator.ledger import Ledger
from camera_drivers.qx10.simulator.model import CameraModel
from flight_file.frame import NS_PER_S

_LOOK_S = 0.02
_DRIP_S = 0.05


class Power:
    """Switches the camera on and off.

    Parameters
    ----------
    set_on
        Opens or closes the camera's ports.
    """

    def __init__(self, model: CameraModel, clock: Clock, set_on: Callable[[bool], None]) -> None:
        self._model = model
        self._clock = clock
        self._set_on = set_on
        self._silent_until_ns = 0
        self._over = threading.Event()
        self.is_on = True

    def reboot(self) -> None:
        """Disappear, and come back after a while as after switching on."""
        self.is_on = False
        self._later(0.0, self._gone)

    def overheat(self) -> None:
        """Report an error for a while, then disappear."""
        self._model.fail()
        self._later(self._model.behaviour.error_s, self._gone)

    def fall_silent(self) -> None:
        """Answer nothing for a while."""
        self._silent_until_ns = self._clock.read().monotonic_ns + round(self._model.behaviour.silent_s * NS_PER_S)

    def wait_while_silent(self) -> None:
        """Wait until there are answers again."""
        while self._clock.read().monotonic_ns < self._silent_until_ns and not self._over.wait(_LOOK_S):
            pass

    def end(self) -> None:
        """Cancel what was to happen later."""
        self._over.set()

    def _later(self, seconds: float, act: Callable[[], None]) -> None:
        def wait_and_act() -> None:
            if not self._over.wait(seconds):
                act()

        threading.Thread(target=wait_and_act, name="simulated power", daemon=True).start()

    def _gone(self) -> None:
        self.is_on = False
        self._set_on(False)
        if self._over.wait(self._model.behaviour.reboot_s):
            return
        self._model.switch_on()
        self.is_on = True
        self._set_on(True)


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of the camera that faults act on."""

    model: CameraModel
    fault_schedule: FaultSchedule
    ledger: Ledger
    power: Power
    address: str


class Handler(Protocol):
    """What a fault may do to its request."""

    @property
    def parts(self) -> Parts:
        """The parts of the camera."""

    def cut(self) -> None:
        """Close the connection without an answer."""

    def answer(self, document: dict[str, Any], status: int = 200) -> None:
        """Send a document as JSON."""

    def send_bytes(self, status: int, kind: str, body: bytes) -> None:
        """Send a body whole."""

    def send(self, status: int, kind: str, blocks: Iterator[bytes], *, length: int | None) -> None:
        """Send a body block by block."""


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
