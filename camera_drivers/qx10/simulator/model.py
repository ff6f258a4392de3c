"""The simulated camera itself: its state, and what each call does to it.

    IDLE ──shot──▶ StillCapturing ──▶ StillSaving ──▶ IDLE            overheated: Error

It knows nothing of HTTP. Its answers are results, or an error's code.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from camera_drivers.clock import Clock
from camera_drivers.qx10.remote_api import Code
from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.body import DIRECTIONS, CameraTime, Lens, Settings
from camera_drivers.qx10.simulator.ledger import Ledger
from camera_drivers.qx10.simulator.methods import CHOICES, SYSTEM_METHODS, offered, snapshot
from camera_drivers.qx10.simulator.pictures import Source, Taken, as_small, with_exif
from flight_file.frame import NS_PER_S

KEPT_PICTURES = 8
POLL_LOOK_S = 0.02
CARD_PICTURES = 5000  # that the memory card has room for
UNFINISHED_ANSWERS = 2  # answers "not finished" after a shot that takes long

# Not with a clock of the same second: pictures in the camera's own name carry whole seconds and a number.
_QUERY = "?%211234%21http%2dget%3a%2a%3aimage%2fjpeg%3a%2a%21%21%21%21%21"


class RefusedCallError(Exception):
    """The call is answered with an error."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class CameraModel:
    """The camera's state; used by several threads.

    Parameters
    ----------
    source
        The pictures it takes.
    address
        Where it serves pictures, as it says itself: scheme, host and port.
    """

    def __init__(self, source: Source, behaviour: Behaviour, clock: Clock, ledger: Ledger, address: str) -> None:
        self.behaviour = behaviour
        self._source = source
        self._clock = clock
        self._ledger = ledger
        self._address = address
        self._lock = threading.RLock()
        self._shots = 0
        self._time = CameraTime(clock, behaviour.clock_offset_s)
        self._pictures: dict[str, bytes] = {}
        self._changes = 0
        self.switch_on()

    def switch_on(self) -> None:
        """Reset to the state after switching on: lens at wide, settings at their defaults, nothing under way."""
        with self._lock:
            self._lens = Lens(self._clock, self.behaviour.zoom_percent_per_s)
            self.settings = Settings(self._clock, self.behaviour.apply_s)
            self._capturing = False
            self._idle_at_ns = 0
            self._failed = False
            self._unfinished = 0
            self._last = ""
            self._told = ""
            self._polling = False
            self.liveview = False

    def turn_clock(self, seconds: float) -> None:
        """Turn the camera's clock ahead by this much, or back."""
        with self._lock:
            self._time.turn(seconds)

    def fail(self) -> None:
        """Overheat, until it is switched on again."""
        with self._lock:
            self._failed = True

    def hide_last(self) -> None:
        """Lose the answer to the last shot: only a camera that remembers repeats it."""
        with self._lock:
            if not self.behaviour.remembers_shot:
                self._last = ""

    def stay_unfinished(self) -> None:
        """Let the last shot take longer than its answer."""
        with self._lock:
            self._unfinished = UNFINISHED_ANSWERS

    def picture(self, name: str) -> bytes | None:
        """Return a picture that the camera still holds."""
        with self._lock:
            return self._pictures.get(name)

    def live_picture(self) -> bytes:
        """Return what the liveview shows now."""
        with self._lock:
            number = self._shots
            self._shots += 1
        return self._source(number)

    @property
    def status(self) -> str:
        """The status in `getEvent`."""
        with self._lock:
            if self._failed:
                return "Error"
            if self._capturing:
                return "StillCapturing"
            return "StillSaving" if self._clock.read().monotonic_ns < self._idle_at_ns else "IDLE"

    def call(self, service: str, method: str, params: list[Any], version: object) -> list[Any]:
        """Carry out a call and return its result; raises RefusedCallError."""
        if method in self.behaviour.forbidden:
            raise RefusedCallError(Code.FORBIDDEN)
        names = SYSTEM_METHODS if service == "system" else self._offered()
        if method not in names:
            raise RefusedCallError(Code.NO_SUCH_METHOD)
        if version not in (("1.0", "1.1") if method == "getEvent" else ("1.0",)):
            raise RefusedCallError(Code.UNSUPPORTED_VERSION)
        for prefix, act in (("getAvailable", self._available), ("set", self._set), ("get", self._get)):
            if method.startswith(prefix) and method[len(prefix) :] in CHOICES:
                return act(method[len(prefix) :], params)
        if method not in _CALLS:
            raise RefusedCallError(Code.NO_SUCH_METHOD)
        return _CALLS[method](self, params)

    def _offered(self) -> list[str]:
        with self._lock:
            return offered(self.settings.chosen["ShootMode"], self.settings.chosen["ExposureMode"])

    def _get(self, name: str, _params: list[Any]) -> list[Any]:
        with self._lock:
            value = self.settings.shown(name)
        if name == "WhiteBalance":
            return [{"whiteBalanceMode": value, "colorTemperature": -1}]
        if isinstance(value, tuple):
            return [{"aspect": value[0], "size": value[1]}]
        return [value]

    def _available(self, name: str, params: list[Any]) -> list[Any]:
        return [*self._get(name, params), list(CHOICES[name].candidates)]

    def _set(self, name: str, params: list[Any]) -> list[Any]:
        value = tuple(params) if name == "StillSize" else (params or [None])[0]
        if value not in CHOICES[name].candidates:
            raise RefusedCallError(Code.ILLEGAL_ARGUMENT)
        if self.status != "IDLE":
            raise RefusedCallError(Code.ANY)
        with self._lock:
            self.settings.put(name, value)
            self._changes += 1
        return [0]

    def _api_list(self, _params: list[Any]) -> list[Any]:
        return [self._offered()]

    def _shoot(self, _params: list[Any]) -> list[Any]:
        with self._lock:
            if self.settings.chosen["ShootMode"] != "still" or self.status != "IDLE":
                raise RefusedCallError(Code.NOT_READY)
            self._capturing = True
            self._changes += 1
        self._sleep(self.behaviour.shot_s)
        with self._lock:
            name = self._keep_picture()
            self._capturing = False
            self._idle_at_ns = self._clock.read().monotonic_ns + round(self.behaviour.save_s * NS_PER_S)
            self._changes += 1
        return [[self._url(name)]]

    def _keep_picture(self) -> str:
        number = self._shots
        self._shots += 1
        now = self._time.now()
        # The camera appends a number to the second; ours counts all shots, so that no name comes twice.
        name = f"pict{now:%y%m%d_%H%M%S}{number % 10000:04d}.JPG"
        jpeg = self._source(number)
        if self.settings.chosen["PostviewImageSize"] == "2M":
            jpeg = as_small(jpeg)
        self._pictures[name] = with_exif(jpeg, Taken(number, now, self._lens.focal_length_mm))
        for old in list(self._pictures)[:-KEPT_PICTURES]:
            del self._pictures[old]
        self._last = name
        self._told = name if self.behaviour.tells_shots else ""
        self._ledger.take(name)
        return name

    def _await(self, _params: list[Any]) -> list[Any]:
        with self._lock:
            if self._unfinished > 0:
                self._unfinished -= 1
                raise RefusedCallError(Code.NOT_FINISHED)
            if not self._last:
                raise RefusedCallError(Code.SHOOTING_FAILED)
            return [[self._url(self._last)]]

    def _zoom(self, params: list[Any]) -> list[Any]:
        direction, movement = (*params, None, None)[:2]
        if direction not in DIRECTIONS or movement not in {"start", "stop", "1shot"}:
            raise RefusedCallError(Code.ILLEGAL_ARGUMENT)
        with self._lock:
            self._changes += 1
            if not self._lens.act(direction, movement):
                raise RefusedCallError(Code.ILLEGAL_STATE)
        return [0]

    def _start_liveview(self, _params: list[Any]) -> list[Any]:
        self.liveview = True
        return [f"{self._address}/liveview.JPG{_QUERY}"]

    def _stop_liveview(self, _params: list[Any]) -> list[Any]:
        self.liveview = False
        return [0]

    def _set_time(self, params: list[Any]) -> list[Any]:
        try:
            with self._lock:
                self._time.set(params[0])
        except (LookupError, TypeError, ValueError) as error:
            raise RefusedCallError(Code.ILLEGAL_ARGUMENT) from error
        return []

    def _event(self, params: list[Any]) -> list[Any]:
        if not params or params[0] is not True:
            return self._events()
        with self._lock:
            if self._polling:
                raise RefusedCallError(Code.ALREADY_POLLING)
            self._polling = True
        try:
            before = self._news()
            end_ns = self._clock.read().monotonic_ns + round(self.behaviour.long_poll_s * NS_PER_S)
            while self._news() == before:
                if self._clock.read().monotonic_ns >= end_ns:
                    raise RefusedCallError(Code.TIMEOUT)
                self._sleep(POLL_LOOK_S)
        finally:
            with self._lock:
                self._polling = False
        return self._events()

    def _news(self) -> tuple[object, ...]:
        with self._lock:
            return (self._changes, self.status, self.liveview)

    def _events(self) -> list[Any]:
        with self._lock:
            return snapshot(
                names=self._offered(),
                status=self.status,
                zoom_percent=round(self._lens.position),
                liveview=self.liveview,
                told=self._url(self._told) if self._told else "",
                room=CARD_PICTURES - len(self._ledger.taken),
                settings=self.settings.chosen,
            )

    def _url(self, name: str) -> str:
        return f"{self._address}/{name}{_QUERY}"

    def _sleep(self, seconds: float) -> None:
        self._clock.wait_until(self._clock.read().monotonic_ns + round(seconds * NS_PER_S), threading.Event())


_CALLS: dict[str, Callable[[CameraModel, list[Any]], list[Any]]] = {
    "getAvailableApiList": CameraModel._api_list,  # noqa: SLF001 - its own
    "getApplicationInfo": lambda _model, _params: ["Smart Remote Control", "2.1.1"],
    "getVersions": lambda _model, _params: [["1.0", "1.1"]],
    "getEvent": CameraModel._event,  # noqa: SLF001 - its own
    "actTakePicture": CameraModel._shoot,  # noqa: SLF001 - its own
    "awaitTakePicture": CameraModel._await,  # noqa: SLF001 - its own
    "actZoom": CameraModel._zoom,  # noqa: SLF001 - its own
    "startLiveview": CameraModel._start_liveview,  # noqa: SLF001 - its own
    "stopLiveview": CameraModel._stop_liveview,  # noqa: SLF001 - its own
    "setCurrentTime": CameraModel._set_time,  # noqa: SLF001 - its own
}
