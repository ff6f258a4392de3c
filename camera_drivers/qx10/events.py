"""The camera's state, combined from the answers to `getEvent`.

An answer is a row of objects, each with its `type`; some are rows of such objects; a null means nothing new. They are
looked up by type, never by position, and anything undocumented is ignored.

A thread, `Watcher`, keeps a call open that waits for news, so that the camera's Wi-Fi is never idle for long and an
overheating camera is noticed between two pictures. It has its own link, because such a call lasts until something
happens. Nothing depends on it: whatever a picture needs is requested when it is needed, and a camera that cannot do
this, or not now, works without it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from camera_drivers.errors import CameraError, CameraRefusedError
from camera_drivers.qx10.remote_api import Code, RemoteApi
from camera_drivers.thresholds import AGAIN_S, CLOSE_S, NEWS_REST_S, REMEMBERED_PICTURES
from camera_drivers.waiting import Stopped
from flight_file.frame import CameraStatus
from flight_file.untrusted import shown

EVENT_VERSION = "1.0"  # the camera has 1.1 too, which adds only the focus; a client that requested more failed
IDLE = "IDLE"
ERROR = "Error"  # too hot, or no card


@dataclass(frozen=True, slots=True)
class CameraState:
    """The state the camera reported last; None where it did not.

    Attributes
    ----------
    status
        `IDLE`, `NotReady`, `StillCapturing`, `StillSaving`, `Error` and so on.
    zoom_position
        0 (wide) to 100 (tele) percent.
    room
        Pictures that the memory card has room for; it falls with each picture.
    """

    status: str | None = None
    zoom_position: float | None = None
    liveview: bool | None = None
    room: int | None = None


class Events:
    """The camera's state, for several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._state = CameraState()
        self._pictures: deque[str] = deque(maxlen=REMEMBERED_PICTURES)

    @property
    def state(self) -> CameraState:
        """The state as far as known."""
        with self._lock:
            return self._state

    @property
    def pictures(self) -> tuple[str, ...]:
        """Addresses of pictures that the camera announced unasked, oldest first."""
        with self._lock:
            return tuple(self._pictures)

    def ask(self, api: RemoteApi, *, wait: bool = False) -> CameraState:
        """Ask for the state now, or wait for news of it; raises as `RemoteApi.call`."""
        limit_s = api.link.limits.event_s if wait else None
        answer = api.call("getEvent", wait, version=EVENT_VERSION, limit_s=limit_s)
        with self._lock:
            for item in _items(answer):
                self._state = _merged(self._state, item)
                self._pictures.extend(url for url in _urls(item) if url not in self._pictures)
            return self._state


def _items(answer: list[Any]) -> Iterator[dict[str, Any]]:
    for entry in answer:
        for item in entry if isinstance(entry, list) else (entry,):
            if isinstance(item, dict):
                yield item


def _merged(state: CameraState, item: dict[str, Any]) -> CameraState:
    match item:
        case {"type": "cameraStatus", "cameraStatus": str(status)}:
            return replace(state, status=shown(status))
        case {"type": "zoomInformation", "zoomPosition": int(position) | float(position)} if 0 <= position <= 100:  # noqa: PLR2004 - percent
            return replace(state, zoom_position=float(position))
        case {"type": "liveviewStatus", "liveviewStatus": bool(running)}:
            return replace(state, liveview=running)
        case {"type": "storageInformation", "numberOfRecordableImages": int(room)} if room >= 0:
            return replace(state, room=room)
    return state


def _urls(item: dict[str, Any]) -> Iterator[str]:
    if item.get("type") == "takePicture" and isinstance(item.get("takePictureUrl"), list):
        yield from (url for url in item["takePictureUrl"] if isinstance(url, str))


class Watcher(threading.Thread):
    """Waits for news until it is told to stop.

    Parameters
    ----------
    api
        With a link of its own, whose waiter only this thread uses.
    """

    def __init__(self, api: RemoteApi, events: Events) -> None:
        super().__init__(name="qx10 watcher", daemon=True)
        self._api = api
        self._events = events
        self._waiter = api.link.waiter

    def run(self) -> None:
        """Ask until told to stop."""
        try:
            while True:
                self._waiter.pause("news", self._ask())
        except Stopped:
            return

    def stop(self) -> None:
        """Stop the thread and abort its pending call."""
        self._waiter.stop.set()
        self.join(CLOSE_S)

    def _ask(self) -> float:
        try:
            self._events.ask(self._api, wait=True)
        except CameraRefusedError as error:
            # "Timeout" means that the camera has no news.
            return AGAIN_S if error.code == Code.TIMEOUT else NEWS_REST_S
        except CameraError:
            return NEWS_REST_S
        return AGAIN_S


class SilentReporter:
    """A reporter for a thread whose waits do not show progress of the camera."""

    def report(self, status: CameraStatus) -> None:
        """Ignore it."""

    def lost(self, reason: str) -> None:
        """Ignore it."""

    def waiting(self, reason: str) -> None:
        """Ignore it."""
