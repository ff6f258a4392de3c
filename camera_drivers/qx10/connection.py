"""Connecting: a camera is found, described, and set up as configured.

look ──url──▶ describe ──services──▶ clock ──▶ settings ──▶ zoom ──▶ connected
│               │                     └─────────┴──────────┴── refused: reported, and goes on
└── nothing ────┴── no camera, or silent: CameraError
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from urllib.parse import urlsplit

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraRefusedError
from camera_drivers.qx10.addresses import host_of
from camera_drivers.qx10.discovery import Description, fetch_description, first_camera
from camera_drivers.qx10.events import Events, SilentReporter, Watcher
from camera_drivers.qx10.link import Link
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.waiting import Waiter, begin
from flight_file.untrusted import shown

DRIVER = "qx10"


@dataclass(frozen=True, slots=True)
class Connection:
    """A camera that was found and answers."""

    api: RemoteApi
    events: Events
    watcher: Watcher | None
    identity: CameraIdentity


def find(options: Qx10Settings, clock: Clock, waiter: Waiter) -> tuple[Link, Description]:
    """Find the configured camera, or else one on the network that describes itself as one, by `first_camera`.

    Raises
    ------
    CameraNotFoundError
        There is none.
    CameraError
        What is there does not answer.
    """
    if options.url is not None:
        return _configured(options.url, options, waiter)
    host, description = first_camera(options, clock, waiter)
    return Link(host, options.limits, waiter), description


def connect(options: Qx10Settings, clock: Clock, waiter: Waiter) -> Connection:
    """Find the camera and start watching it; raises as `find`."""
    link, description = find(options, clock, waiter)
    api = RemoteApi(link, description.services)
    events = Events()
    watcher = None
    if options.long_poll:
        watcher = Watcher(RemoteApi(link.parallel(clock, SilentReporter()), description.services), events)
        begin(watcher, "getEvent")
    try:
        note = _application(api) + _of_several(description)
        identity = CameraIdentity(DRIVER, description.name, description.serial, note)
    except BaseException:
        if watcher is not None:
            watcher.stop()
        raise
    return Connection(api, events, watcher, identity)


def _configured(url: str, options: Qx10Settings, waiter: Waiter) -> tuple[Link, Description]:
    link = Link(host_of(url), options.limits, waiter)
    limit_s = options.limits.call_s
    exchange = link.exchange(2 * limit_s)
    work = partial(fetch_description, exchange, url)
    return link, waiter.until_done("description", work, exchange.abort, limit_s=limit_s)


def _of_several(description: Description) -> str:
    """Say which of several cameras it is."""
    if not description.others:
        return ""
    others = ", ".join(description.others)
    return f", of {len(description.others) + 1} cameras the one with the lowest address; camera.url chooses: {others}"


def _application(api: RemoteApi) -> str:
    """Describe the camera's software, as it calls itself, and its address."""
    try:
        result = api.call("getApplicationInfo")
    except CameraRefusedError:
        result = []
    words = " ".join(word for word in result if isinstance(word, str))
    return f"{shown(words)} at {shown(urlsplit(api.services['camera']).netloc)}".strip()
