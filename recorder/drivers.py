"""Which camera a configuration asks for, on which clock, and what happens when the disk is slower than the camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from camera_drivers.camera import Camera
from camera_drivers.clock import Clock
from camera_drivers.replay.camera import ReplayCamera, open_source
from recorder.clock import SimulatedClock
from recorder.config import RecorderConfig, ReplaySettings
from recorder.errors import ConfigurationError
from recorder.host import Host


@dataclass(frozen=True, slots=True)
class Wiring:
    """A camera and what belongs to it.

    Attributes
    ----------
    clock
        The clock of the recording.
    live
        The camera cannot wait: when the queue is full, the newest frame is dropped and counted, and the recorder looks
        at its clock while no frame comes. Otherwise the camera is made to wait, and time passes with its frames alone.
    attachments
        What the source brings along, for a recording that attaches no panel of its own.
    """

    camera: Camera
    clock: Clock
    live: bool
    attachments: Mapping[str, bytes] = field(default_factory=dict)


def wire(config: RecorderConfig, host: Host) -> Wiring:
    """Make the camera that the configuration asks for.

    Raises
    ------
    ConfigurationError
        There is no such driver yet.
    CameraError
        The camera cannot be used.
    """
    return _DRIVERS[config.camera.driver](config, host)


def _replay(config: RecorderConfig, host: Host) -> Wiring:
    settings = config.camera
    if not isinstance(settings, ReplaySettings):
        raise TypeError(settings)
    source = open_source(settings.paths, rate_hz=settings.rate_hz, clock=host.clock)
    live = settings.pace == "realtime"
    clock = host.clock if live else SimulatedClock(source.start_ns)
    return Wiring(camera=ReplayCamera(source, clock), clock=clock, live=live, attachments=source.attachments)


def _qx10(_config: RecorderConfig, _host: Host) -> Wiring:
    raise ConfigurationError("camera.driver: qx10 is not part of this version; use replay.")


_DRIVERS: Mapping[str, Callable[[RecorderConfig, Host], Wiring]] = {"replay": _replay, "qx10": _qx10}
