"""The camera's thread: gets frames and hands them over, and never waits for the disk while the camera is live.

    connect ──> frames ──> connect again, always            CameraError: soon, then less and less often; so if no
                      │                                     memory is left, which is counted as a lost picture
                      └──> no more pictures, or stop        CameraUnusableError: seldom, for nobody is there to help
                      └──> the end with an error            ReplayError: a person started the replay, and sees it

The recorder goes on without a camera; the flight says what became of it. `wire` makes the camera that a configuration
asks for, and `CameraReports` takes what its driver reports beside the pictures.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from camera_drivers.camera import Camera, CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraUnusableError, ReplayError
from camera_drivers.picamera.options import PicameraSettings
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.replay.camera import ReplayCamera, open_source
from camera_drivers.replay.options import ReplaySettings
from camera_drivers.replay.video_clocks import Believed
from camera_drivers.reporter import Reporter
from camera_drivers.rtsp.options import RtspSettings
from camera_drivers.uvc.options import UvcSettings
from flight_file.frame import NS_PER_S, CameraStatus, ClockReading
from flight_file.untrusted import shown
from recorder.config import RecorderConfig
from recorder.errors import ConfigurationError
from recorder.frame_queue import NO_MEMORY, STOPPED, Arrival, Drops, Ended, FrameQueue, Notice
from recorder.host import Host, ReportingClock, SimulatedClock
from recorder.supervision import LINE_CHARACTERS, BackOff, Heartbeats, Stop
from recorder.thresholds import CAMERA_AGAIN_S, SAY_S, UNUSABLE_AGAIN_S

NO_MORE_PICTURES = "no more pictures"
_OUT_OF_MEMORY = (
    "No memory is left for the camera, which is connected again; if it stays so, set smaller pictures, or end other"
    " programs."
)


@dataclass(frozen=True, slots=True)
class Wiring:
    """A camera with its clock and attachments.

    Attributes
    ----------
    clock
        The clock of the recording.
    live
        Whether the camera cannot wait. If so, a full queue drops and counts its oldest frame, time passes also while no
        frame comes, and the recorder keeps trying when the camera or the disk fails. Otherwise the camera is made to
        wait, and only its frames advance the time.
    attachments
        Attachments of the source, for a recording that attaches no panel of its own.
    """

    camera: Camera
    clock: Clock
    live: bool
    attachments: Mapping[str, bytes] = field(default_factory=dict)


def wire(config: RecorderConfig, host: Host, reporter: Reporter) -> Wiring:
    """Make the configured camera; everything that it reports besides its pictures goes to `reporter`.

    Raises
    ------
    ConfigurationError
        There is nothing to replay, or a package that the driver needs is not installed.
    """
    if isinstance(config.camera, ReplaySettings):
        return _replay(config.camera, host, reporter)
    return Wiring(camera=_live_camera(config.camera, host.clock, reporter), clock=host.clock, live=True)


def _replay(settings: ReplaySettings, host: Host, reporter: Reporter) -> Wiring:
    try:
        source = open_source(
            settings.paths,
            rate_hz=settings.rate_hz,
            clock=host.clock,
            believed=Believed(settings.start, settings.clock, settings.utc_offset),
            keep_sound=settings.keep_sound,
        )
    except ReplayError as error:
        raise ConfigurationError(f"camera.path: {error}") from error
    live = settings.pace == "realtime"
    clock = host.clock if live else SimulatedClock(source.start_ns)
    # No thread waits on a simulated clock, and it jumps over a century as easily as over a second.
    heard = ReportingClock(clock, reporter) if live else clock
    return Wiring(
        camera=ReplayCamera(source, heard),
        clock=clock,
        live=live,
        attachments=source.attachments,
    )


def _live_camera(
    settings: Qx10Settings | UvcSettings | PicameraSettings | RtspSettings, clock: Clock, reporter: Reporter
) -> Camera:
    """Make a live camera; its driver is loaded only where one is configured."""
    match settings:
        case Qx10Settings():
            from camera_drivers.qx10.camera import Qx10Camera  # noqa: PLC0415

            return Qx10Camera(settings, clock, reporter)
        case UvcSettings():
            from camera_drivers.uvc.stream import uvc_camera  # noqa: PLC0415

            return uvc_camera(settings, clock, reporter)
        case PicameraSettings():
            from camera_drivers.picamera.process import picamera  # noqa: PLC0415

            return picamera(settings, clock, reporter)
        case RtspSettings():
            try:
                from camera_drivers.rtsp.stream import rtsp_camera  # noqa: PLC0415 - FFmpeg, which not every box has
            except ImportError as error:
                raise ConfigurationError(
                    "camera.driver: rtsp needs PyAV; run systemd/install.sh --driver rtsp, or"
                    " pip install 'image-flight-recorder[video]'."
                ) from error
            return rtsp_camera(settings, clock, reporter)


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
        self._queue.notify(_notice(status, self._clock.read()))

    def lost(self, reason: str) -> None:
        """Count a drop with this reason."""
        self._heartbeats.camera()
        self._drops.add(reason)

    def waiting(self, reason: str) -> None:  # noqa: ARG002 - the watchdog does not care why
        """Feed the watchdog, whatever the reason."""
        self._heartbeats.camera()


def _notice(status: CameraStatus, at: ClockReading, identity: CameraIdentity | None = None) -> Notice:
    """Make a notice whose texts are short and printable, whatever a camera says."""
    plain = replace(status, state=shown(status.state), reason=shown(status.reason, most=LINE_CHARACTERS))
    if identity is None:
        return Notice(plain, at)
    return Notice(plain, at, replace(identity, model=shown(identity.model), serial=shown(identity.serial)))


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
        self._is_connected = False

    def run(self) -> None:
        """Capture; an unexpected exception goes to stderr with its traceback, and the writer is told."""
        reason, error, crashed = "the camera's thread crashed", None, True
        try:
            reason, crashed = self._capture(), False
        except CameraError as failure:
            reason, error, crashed = shown(f"camera failed: {failure}", most=LINE_CHARACTERS), failure, False
        finally:
            self._queue.end(Ended(reason, self._wiring.clock.read(), error, crashed))

    def _capture(self) -> str:
        while not self._stop_request.is_requested:
            failure = self._failed_with()
            if failure is None:
                return self._stop_request.reason or NO_MORE_PICTURES
            self._say_lost(failure)
            self._rest(
                self._back_off.next_ns(UNUSABLE_AGAIN_S if isinstance(failure, CameraUnusableError) else CAMERA_AGAIN_S)
            )
        return self._stop_request.reason

    def _failed_with(self) -> CameraError | None:
        """Use the camera to the end; return what it failed with, if connecting again may help."""
        self._is_connected = False
        try:
            self._use_camera()
        except ReplayError:
            raise
        except CameraError as failure:
            return failure
        except MemoryError:  # not kept: its traceback holds on to what filled the memory
            if self._is_connected:
                self._drops.add(NO_MEMORY)
            return CameraError(_OUT_OF_MEMORY)
        return None

    def _use_camera(self) -> None:
        self._heartbeats.camera()
        with self._wiring.camera as camera:
            self._is_connected = True
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
        self._queue.notify(_notice(status, self._wiring.clock.read(), identity))
        self._trouble = ""

    def _say_lost(self, failure: CameraError) -> None:
        # A camera that stays away for hours is reported once.
        if str(failure) != self._trouble:
            self._trouble = str(failure)
            self._queue.notify(_notice(CameraStatus("lost", self._trouble), self._wiring.clock.read()))

    def _rest(self, duration_ns: int) -> None:
        clock, stop = self._wiring.clock, self._stop_request.event
        until_ns = clock.read().monotonic_ns + duration_ns
        while not stop.is_set() and (now_ns := clock.read().monotonic_ns) < until_ns:
            self._heartbeats.camera()
            clock.wait_until(min(until_ns, now_ns + round(SAY_S * NS_PER_S)), stop)
