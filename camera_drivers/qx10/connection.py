"""Connecting: from nothing known to a camera that is found, described, and set as wanted.

look ──url──▶ describe ──services──▶ clock ──▶ settings ──▶ zoom ──▶ connected
│               │                     └─────────┴──────────┴── refused: reported, and goes on
└── nothing ────┴── no camera, or silent: CameraError
"""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import urlsplit

from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraNotFoundError, CameraRefusedError, CameraUnusableError
from camera_drivers.qx10.addresses import BadUrlError, host_of
from camera_drivers.qx10.description import Description, fetch_description
from camera_drivers.qx10.discovery import search
from camera_drivers.qx10.events import Events
from camera_drivers.qx10.link import Link
from camera_drivers.qx10.options import Options
from camera_drivers.qx10.patience import Patience
from camera_drivers.qx10.remote_api import RemoteApi
from camera_drivers.qx10.watcher import Unheard, Watcher

DRIVER = "qx10"


@dataclass(frozen=True, slots=True)
class Connection:
    """A camera that is there."""

    api: RemoteApi
    events: Events
    watcher: Watcher | None
    identity: CameraIdentity


def find(options: Options, clock: Clock, patience: Patience) -> tuple[Link, Description]:
    """The configured camera, or else the first on the network that describes itself as one.

    Raises
    ------
    CameraNotFoundError
        There is none.
    CameraUnusableError
        The configured URL is none.
    CameraError
        What is there does not answer.
    """
    if options.url is not None:
        return _described(options.url, options, patience)
    last: CameraError | None = None
    for url in search(options, clock, patience):
        try:
            return _described(url, options, patience)
        except CameraError as error:
            last = error
    raise last or CameraNotFoundError("No camera answers on the network; check that it is on, or give camera.url.")


def connect(options: Options, clock: Clock, patience: Patience) -> Connection:
    """Find the camera, and begin to watch it; raises as `find`."""
    link, description = find(options, clock, patience)
    api = RemoteApi(link, description.services)
    events = Events()
    watcher = None
    if options.long_poll:
        watcher = Watcher(RemoteApi(link.parallel(clock, Unheard()), description.services), events)
        watcher.start()
    try:
        identity = CameraIdentity(DRIVER, description.name, description.serial, _application(api))
    except BaseException:
        if watcher is not None:
            watcher.stop()
        raise
    return Connection(api, events, watcher, identity)


def _described(url: str, options: Options, patience: Patience) -> tuple[Link, Description]:
    try:
        host = host_of(url)
    except BadUrlError as error:
        raise CameraUnusableError(f"camera.url: {url} is no http URL; correct it.") from error
    link = Link(host, options.limits, patience)
    return link, fetch_description(link, url)


def _application(api: RemoteApi) -> str:
    """The camera's software, as it calls itself, and where it is."""
    try:
        result = api.call("getApplicationInfo")
    except CameraRefusedError:
        result = []
    words = " ".join(word for word in result if isinstance(word, str))
    return f"{words} at {urlsplit(api.services['camera']).netloc}".strip()
