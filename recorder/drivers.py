"""Which camera a configuration asks for, on which clock, and what happens when the disk is slower than the camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from camera_drivers.camera import Camera
from camera_drivers.clock import Clock
from camera_drivers.qx10.options import Limits, Options
from camera_drivers.replay.camera import ReplayCamera, open_source
from camera_drivers.reporter import Reporter
from recorder.clock import AudibleClock, SimulatedClock
from recorder.host import Host
from recorder.settings import Qx10Settings, RecorderConfig, ReplaySettings


@dataclass(frozen=True, slots=True)
class Wiring:
    """A camera and what belongs to it.

    Attributes
    ----------
    clock
        The clock of the recording.
    live
        The camera cannot wait: when the queue is full, the oldest frame in it is dropped and counted; the recorder
        looks at its clock while no frame comes, and keeps trying when the camera or the disk fails. Otherwise the
        camera is made to wait, and time passes with its frames alone.
    attachments
        What the source brings along, for a recording that attaches no panel of its own.
    """

    camera: Camera
    clock: Clock
    live: bool
    attachments: Mapping[str, bytes] = field(default_factory=dict)


def wire(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    """Make the camera that the configuration asks for; what it says beside its pictures goes to `reporter`.

    Raises
    ------
    CameraError
        The camera cannot be used.
    """
    return _DRIVERS[config.camera.driver](config, host, reporter)


def _replay(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    settings = config.camera
    if not isinstance(settings, ReplaySettings):
        raise TypeError(settings)
    source = open_source(settings.paths, rate_hz=settings.rate_hz, clock=host.clock)
    live = settings.pace == "realtime"
    clock = host.clock if live else SimulatedClock(source.start_ns)
    return Wiring(
        camera=ReplayCamera(source, AudibleClock(clock, reporter)),
        clock=clock,
        live=live,
        attachments=source.attachments,
    )


def _qx10(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    from camera_drivers.qx10.camera import Qx10Camera  # noqa: PLC0415 - a replay does without requests

    settings = config.camera
    if not isinstance(settings, Qx10Settings):
        raise TypeError(settings)
    return Wiring(camera=Qx10Camera(_qx10_options(settings), host.clock, reporter), clock=host.clock, live=True)


def _qx10_options(settings: Qx10Settings) -> Options:
    same = settings.model_dump(exclude={"driver", "limits"})
    limits = settings.limits.model_dump(exclude={"picture_mib"})
    return Options(**same, limits=Limits(**limits, picture_bytes=settings.limits.picture_mib * 2**20))


_DRIVERS: Mapping[str, Callable[[RecorderConfig, Host, Reporter], Wiring]] = {"replay": _replay, "qx10": _qx10}
