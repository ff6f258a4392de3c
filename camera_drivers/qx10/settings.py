"""The camera's settings: which are wanted, and how one is set and verified.

Every setting X of the camera has a call `setX` and a call `getX`. Whether it can be set now is in the list of calls
that the camera offers at the moment, which changes with each mode. A `setX` is answered before it takes effect, so the
setting is read back until it shows. A refused setting is reported once and left as it is: pictures with the wrong white
balance are better than none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from camera_drivers.errors import CameraRefusedError, CameraSilentError
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.qx10.remote_api import Code, RemoteApi
from camera_drivers.thresholds import AGAIN_S
from camera_drivers.waiting import Notes

STATE = "setting"


# The camera is busy, or not there yet; for a while after a shot every setting is refused.
_LATER = frozenset({Code.ANY, Code.TIMEOUT, Code.ILLEGAL_STATE, Code.NOT_READY, Code.NOT_FINISHED, 500, 503})


@dataclass(frozen=True, slots=True)
class Wish:
    """A wanted setting.

    Attributes
    ----------
    name
        As in the names of its calls, e.g. ExposureMode.
    ways
        Parameters to set it with; the second way is tried where the first is refused as wrong.
    shows
        What reading it back must show.
    changes_mode
        Whether it changes which calls the camera offers.
    """

    name: str
    ways: tuple[tuple[object, ...], ...]
    shows: tuple[object, ...]
    changes_mode: bool = False


def wishes(options: Qx10Settings) -> list[Wish]:
    """List the wanted settings in the order in which they have to be set: modes first."""
    wanted = [
        _plain("ShootMode", "still", changes_mode=True),
        _plain("ExposureMode", options.exposure_mode, changes_mode=True),
        _plain("SelfTimer", 0),
        _plain("PostviewImageSize", options.picture),
        _still_size(options.still_size),
        _plain("ExposureCompensation", options.exposure_compensation),
        _plain("IsoSpeedRate", options.iso_speed_rate),
        _white_balance(options.white_balance),
        _plain("BeepMode", options.beep_mode),
    ]
    return [wish for wish in wanted if wish is not None]


def offered(api: RemoteApi) -> frozenset[str]:
    """Ask which calls the camera offers now; raises as `RemoteApi.call`."""
    result = api.call("getAvailableApiList")
    names = result[0] if result and isinstance(result[0], list) else []
    return frozenset(name for name in names if isinstance(name, str))


class Setter:
    """Sets what is wanted."""

    def __init__(self, api: RemoteApi, notes: Notes) -> None:
        self._api = api
        self._notes = notes
        self._offered = frozenset[str]()

    def apply(self, options: Qx10Settings) -> frozenset[str]:
        """Set everything; return the calls that the camera offers afterwards.

        Raises
        ------
        CameraUnreachableError
            The camera cannot be reached any more.
        CameraRefusedError
            It does not even say what it offers.
        """
        limits = options.limits
        if limits.picture_bytes < limits.picture_mib * 2**20:
            stored = f"a flight file takes pictures of {limits.picture_bytes // 2**20} MiB at most"
            self._notes.say_once(STATE, f"limits.picture_mib is not as wanted: {stored}")
        self._offered = offered(self._api)
        for wish in wishes(options):
            problem = self._problem(wish)
            if problem:
                self._notes.say_once(STATE, f"{wish.name} is not as wanted: {problem}")
            elif wish.changes_mode:
                self._offered = offered(self._api)
        return self._offered

    def _problem(self, wish: Wish) -> str:
        if self._shows(wish):
            return ""
        if f"set{wish.name}" not in self._offered:
            return "the camera does not offer it in its present mode"
        try:
            self._set(wish)
        except CameraRefusedError as error:
            return f"the camera refuses it (error {error.code})"
        except CameraSilentError as error:
            return error.problem
        if f"get{wish.name}" not in self._offered:
            return ""  # there is no way to check
        settled = self._api.link.waiter.poll(
            f"set{wish.name}",
            lambda: self._shows(wish),
            every_s=AGAIN_S,
            limit_s=self._api.link.limits.settle_s,
        )
        return "" if settled else "it was accepted, but did not take effect"

    def _set(self, wish: Wish) -> None:
        for way in wish.ways[:-1]:
            try:
                return self._insist(wish.name, way)
            except CameraRefusedError as error:
                if error.code != Code.ILLEGAL_ARGUMENT:
                    raise
        return self._insist(wish.name, wish.ways[-1])

    def _insist(self, name: str, params: tuple[object, ...]) -> None:
        last: list[CameraRefusedError | CameraSilentError] = []

        def done() -> bool:
            try:
                self._api.call(f"set{name}", *params)
            except CameraRefusedError as error:
                if error.code not in _LATER:
                    raise
                last[:] = [error]
                return False
            except CameraSilentError as error:
                last[:] = [error]
                return False
            return True

        limit_s = self._api.link.limits.settle_s
        if not self._api.link.waiter.poll(f"set{name}", done, every_s=AGAIN_S, limit_s=limit_s):
            raise last[0]

    def _shows(self, wish: Wish) -> bool:
        if f"get{wish.name}" not in self._offered:
            return False
        try:
            result = self._api.call(f"get{wish.name}")
        except (CameraRefusedError, CameraSilentError):
            return False
        return all(value in _values(result) for value in wish.shows)


def _values(result: list[Any]) -> list[Any]:
    first = result[0] if result else None
    return list(first.values()) if isinstance(first, dict) else [first]


def _plain(name: str, value: object, *, changes_mode: bool = False) -> Wish | None:
    return None if value is None else Wish(name, ((value,),), (value,), changes_mode)


def _white_balance(mode: str | None) -> Wish | None:
    return None if mode is None else Wish("WhiteBalance", ((mode, False, -1),), (mode,))


def _still_size(size: tuple[str, str] | None) -> Wish | None:
    # The aspect first is documented; other clients were seen to send the size first.
    return None if size is None else Wish("StillSize", (size, size[::-1]), size)
