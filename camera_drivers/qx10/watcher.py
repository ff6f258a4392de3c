"""A thread that keeps a call open which waits for the camera's news.

So the camera's Wi-Fi is never idle for long, and an overheating camera is noticed between two pictures. It has its own
way to the camera, because such a call takes as long as nothing happens. Nothing depends on it: what a picture needs to
know is asked for when it is needed, and a camera that cannot do this, or not now, works without.
"""

from __future__ import annotations

import threading

from camera_drivers.errors import CameraError, CameraRefusedError
from camera_drivers.qx10.events import Events
from camera_drivers.qx10.patience import Stopped
from camera_drivers.qx10.remote_api import Code, RemoteApi
from flight_file.reports import CameraStatus

BREATH_S = 0.2  # between two calls that were answered, however fast the camera answers
REST_S = 5.0  # after one that failed

LEAVE_S = 1.0


class Watcher(threading.Thread):
    """Waits for news until it is told to stop.

    Parameters
    ----------
    api
        With a link of its own, whose patience this thread alone uses.
    """

    def __init__(self, api: RemoteApi, events: Events) -> None:
        super().__init__(name="qx10 watcher", daemon=True)
        self._api = api
        self._events = events
        self._patience = api.link.patience

    def run(self) -> None:
        """Ask, again and again."""
        try:
            while True:
                self._patience.pause("news", self._ask())
        except Stopped:
            return

    def stop(self) -> None:
        """End it, and the call that it waits for."""
        self._patience.stop.set()
        self.join(LEAVE_S)

    def _ask(self) -> float:
        try:
            self._events.ask(self._api, wait=True)
        except CameraRefusedError as error:
            # "Timeout" is how the camera says that there is no news.
            return BREATH_S if error.code == Code.TIMEOUT else REST_S
        except CameraError:
            return REST_S
        return BREATH_S


class Unheard:
    """A reporter for a thread whose waiting is no sign that the camera makes progress."""

    def report(self, status: CameraStatus) -> None:
        """Nobody hears it."""

    def lost(self, reason: str) -> None:
        """Nobody hears it."""

    def waiting(self, reason: str) -> None:
        """Nobody hears it."""
