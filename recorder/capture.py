"""The camera's thread: gets frames and hands them over, and never waits for the disk while the camera is live.

    connect ──> frames ──> connect again, for ever          CameraError: soon, then less and less often
                      └──> no more pictures, or stop        CameraUnusableError: seldom, for nobody is there to help
                      └──> the end with an error            ReplayError: whoever started the replay is there

The recorder goes on without a camera; the flight says what became of it. `wire` makes the camera that a configuration
asks for, and `CameraReports` is where its driver reports what is no picture.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from camera_drivers.camera import Camera
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraUnusableError, ReplayError
from camera_drivers.live.camera import Pace
from camera_drivers.qx10.options import Limits, Options
from camera_drivers.replay.camera import ReplayCamera, open_source
from camera_drivers.replay.video_clocks import Believed
from camera_drivers.reporter import Reporter
from flight_file.frame import NS_PER_S, CameraStatus
from recorder.config import RecorderConfig
from recorder.errors import ConfigurationError
from recorder.frame_queue import STOPPED, Arrival, Drops, Ended, FrameQueue, Notice
from recorder.host import Host, ReportingClock, SimulatedClock
from recorder.settings.cameras import (
    LiveSettings,
    PicameraSettings,
    Qx10Settings,
    ReplaySettings,
    RtspSettings,
    UvcSettings,
)
from recorder.supervision import BackOff, Heartbeats, Stop
from recorder.thresholds import CAMERA_AGAIN_S, SAY_S, UNUSABLE_AGAIN_S

NO_MORE_PICTURES = "no more pictures"
_PACE = frozenset({"interval_s", "stall_s", "frozen_s"})


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
    ConfigurationError
        There is nothing to replay.
    """
    return _DRIVERS[config.camera.driver](config, host, reporter)


def _replay(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    settings = config.camera
    if not isinstance(settings, ReplaySettings):
        raise TypeError(settings)
    try:
        believed = Believed(settings.start, settings.clock, settings.utc_offset)
        source = open_source(
            settings.paths,
            rate_hz=settings.rate_hz,
            clock=host.clock,
            believed=believed,
            keep_sound=settings.keep_sound,
        )
    except ReplayError as error:
        raise ConfigurationError(f"camera.path: {error}") from error
    live = settings.pace == "realtime"
    clock = host.clock if live else SimulatedClock(source.start_ns)
    # Nobody waits with a simulated clock, and a century is no more steps to it than a second.
    heard = ReportingClock(clock, reporter) if live else clock
    return Wiring(
        camera=ReplayCamera(source, heard),
        clock=clock,
        live=live,
        attachments=source.attachments,
    )


def _qx10(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    from camera_drivers.qx10.camera import Qx10Camera  # noqa: PLC0415 - a replay does without HTTP

    settings = config.camera
    if not isinstance(settings, Qx10Settings):
        raise TypeError(settings)
    return Wiring(camera=Qx10Camera(_qx10_options(settings), host.clock, reporter), clock=host.clock, live=True)


def _qx10_options(settings: Qx10Settings) -> Options:
    same = settings.model_dump(exclude={"driver", "limits"})
    limits = settings.limits.model_dump(exclude={"picture_mib"})
    return Options(**same, limits=Limits(**limits, picture_bytes=settings.limits.picture_mib * 2**20))


def _pace(settings: LiveSettings) -> Pace:
    return Pace(**settings.model_dump(include=set(_PACE)))


def _uvc(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    from camera_drivers.uvc.options import Options as UvcOptions  # noqa: PLC0415 - only who has such a camera
    from camera_drivers.uvc.stream import uvc_camera  # noqa: PLC0415 - the same

    settings = config.camera
    if not isinstance(settings, UvcSettings):
        raise TypeError(settings)
    options = UvcOptions(**settings.model_dump(exclude={"driver", *_PACE}), pace=_pace(settings))
    return Wiring(camera=uvc_camera(options, host.clock, reporter), clock=host.clock, live=True)


def _picamera(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    from camera_drivers.picamera.options import Options as PicameraOptions  # noqa: PLC0415 - only who has such a camera
    from camera_drivers.picamera.process import picamera  # noqa: PLC0415 - the same

    settings = config.camera
    if not isinstance(settings, PicameraSettings):
        raise TypeError(settings)
    options = PicameraOptions(**settings.model_dump(exclude={"driver", *_PACE}), pace=_pace(settings))
    return Wiring(camera=picamera(options, host.clock, reporter), clock=host.clock, live=True)


def _rtsp(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    try:
        from camera_drivers.rtsp.stream import rtsp_camera  # noqa: PLC0415 - FFmpeg, which not every box has
    except ImportError as error:
        raise ConfigurationError(
            "camera.driver: rtsp needs PyAV; run systemd/install.sh --driver rtsp, or"
            " pip install 'image-flight-recorder[video]'."
        ) from error
    from camera_drivers.rtsp.options import Options as RtspOptions  # noqa: PLC0415 - only who has such a camera

    settings = config.camera
    if not isinstance(settings, RtspSettings):
        raise TypeError(settings)
    options = RtspOptions(**settings.model_dump(exclude={"driver", *_PACE}), pace=_pace(settings))
    return Wiring(camera=rtsp_camera(options, host.clock, reporter), clock=host.clock, live=True)


_DRIVERS: Mapping[str, Callable[[RecorderConfig, Host, Reporter], Wiring]] = {
    "replay": _replay,
    "qx10": _qx10,
    "uvc": _uvc,
    "picamera": _picamera,
    "rtsp": _rtsp,
}


class CameraReports:
    """Hands the reports to the writer's thread, in order with the frames; see `camera_drivers.reporter.Reporter`."""

    def __init__(self, *, queue: FrameQueue, drops: Drops, heartbeats: Heartbeats, clock: Clock) -> None:
        self._queue = queue
        self._drops = drops
        self._heartbeats = heartbeats
        self._clock = clock

    def report(self, status: CameraStatus) -> None:
        """Store the report in the flight."""
        self._heartbeats.camera()
        self._queue.notify(Notice(status, self._clock.read()))

    def lost(self, reason: str) -> None:
        """Count a drop with this reason."""
        self._heartbeats.camera()
        self._drops.add(reason)

    def waiting(self, reason: str) -> None:  # noqa: ARG002 - the watchdog does not care why
        """Feed the watchdog."""
        self._heartbeats.camera()


class Capture(threading.Thread):
    """Runs a camera until it has no more pictures or is told to stop; then ends the queue, whatever happened.

    It is a daemon thread: a camera that hangs must not keep the process from ending.
    """

    def __init__(self, wiring: Wiring, *, queue: FrameQueue, drops: Drops, heartbeats: Heartbeats, stop: Stop) -> None:
        super().__init__(name="capture", daemon=True)
        self._wiring = wiring
        self._queue = queue
        self._drops = drops
        self._heartbeats = heartbeats
        self._stop_request = stop
        self._back_off = BackOff()
        self._trouble = ""

    def run(self) -> None:
        """Capture; an unexpected exception goes to stderr with its traceback, and the writer is told."""
        reason, error, crashed = "the camera's thread crashed", None, True
        try:
            reason, crashed = self._capture(), False
        except CameraError as failure:
            reason, error, crashed = f"camera failed: {failure}", failure, False
        finally:
            self._queue.end(Ended(reason, self._wiring.clock.read(), error, crashed))

    def _capture(self) -> str:
        while not self._stop_request.is_requested:
            try:
                self._use_camera()
            except ReplayError:
                raise
            except CameraError as failure:
                self._say_lost(failure)
                self._rest(
                    self._back_off.next_ns(
                        UNUSABLE_AGAIN_S if isinstance(failure, CameraUnusableError) else CAMERA_AGAIN_S
                    )
                )
            else:
                return self._stop_request.reason or NO_MORE_PICTURES
        return self._stop_request.reason

    def _use_camera(self) -> None:
        self._heartbeats.camera()
        with self._wiring.camera as camera:
            self._say_capturing()
            while (frame := camera.next_frame(self._stop_request.event)) is not None:
                self._heartbeats.camera()
                self._back_off.reset()
                self._hand_over(Arrival(frame, self._wiring.clock.read()))

    def _hand_over(self, arrival: Arrival) -> None:
        if self._wiring.live:
            lost = self._queue.push(arrival)
            if lost:
                self._drops.add_overflow(lost)
        elif not self._queue.put(arrival, self._stop_request.event):
            self._drops.add(STOPPED)

    def _say_capturing(self) -> None:
        if not self._wiring.live:
            return  # the recording of a replay that waits for the disk begins with this already
        identity, failures = self._wiring.camera.identity, self._back_off.failures
        parts = [part for part in (identity.driver, identity.note) if part]
        again = f" (after {failures} failed {'attempt' if failures == 1 else 'attempts'})" if failures else ""
        status = CameraStatus("capturing", ": ".join(parts) + again)
        self._queue.notify(Notice(status, self._wiring.clock.read(), identity))
        self._trouble = ""

    def _say_lost(self, failure: CameraError) -> None:
        # A camera that stays away for hours is news once.
        if str(failure) != self._trouble:
            self._trouble = str(failure)
            self._queue.notify(Notice(CameraStatus("lost", self._trouble), self._wiring.clock.read()))

    def _rest(self, duration_ns: int) -> None:
        clock, stop = self._wiring.clock, self._stop_request.event
        until_ns = clock.read().monotonic_ns + duration_ns
        while not stop.is_set() and (now_ns := clock.read().monotonic_ns) < until_ns:
            self._heartbeats.camera()
            clock.wait_until(min(until_ns, now_ns + round(SAY_S * NS_PER_S)), stop)
