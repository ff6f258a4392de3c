"""Record: from a configuration to flight files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flight_file.errors import FlightNotWrittenError
from flight_file.reports import CameraStatus
from flight_file.segments import FlightWriter, Plan
from recorder.attachments import gather_attachments
from recorder.capture import Capture, Drops
from recorder.config import RecorderConfig
from recorder.drivers import Wiring, wire
from recorder.errors import RecorderError
from recorder.frame_queue import Arrival, Ended, FrameQueue
from recorder.host import Host
from recorder.journal import Journal
from recorder.journal_reporter import JournalReporter
from recorder.plan import clock_name, plan_recording
from recorder.recording import Gauges, Recording
from recorder.stop import Stop

IDLE_S = 1.0  # how long the writer waits for a frame before it looks at its clock
PATIENCE_S = 3.0  # how long a camera may take to notice that it shall stop


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run has recorded.

    Attributes
    ----------
    reason
        Why it ended.
    paths
        The finished segments, in order.
    stored, dropped
        Frames.
    """

    recording: str
    reason: str
    paths: tuple[Path, ...]
    stored: int
    dropped: int


def record(
    config: RecorderConfig,
    *,
    host: Host,
    stop: Stop | None = None,
    journal: Journal | None = None,
    configuration: bytes = b"",
    name: str | None = None,
) -> Outcome:
    """Record until the camera has no more pictures or somebody asks to stop.

    Everything that differs from run to run comes through `host`: with `recorder.testing.fixed_host` and `pace:
    fastest`, recording the same pictures twice gives the same bytes. A fast replay runs on a clock that begins with
    the first picture's own time and jumps from picture to picture, so the recording's name and its log times are those
    of the pictures.

    Parameters
    ----------
    config
        From `recorder.config.load_config` or `parse_config`.
    host
        The machine; `recorder.host.this_host()` or `recorder.testing.fixed_host(clock)`.
    stop
        To end the run from elsewhere.
    journal
        Where the log goes; stderr if not given.
    configuration
        Bytes of recorder.yaml, carried as an attachment; empty for none.
    name
        Of the recording; its start time if not given. A name that is taken gets a number.

    Raises
    ------
    ConfigurationError
        The configuration cannot be carried out.
    CameraError
        The camera failed; what it gave before is stored and the files are closed.
    FlightNotWrittenError
        The disk failed; what was synced before stays, in a file that ends in `.part`.
    RecorderError
        The camera's thread crashed; what it gave before is stored and the files are closed.
    """
    stop = stop or Stop()
    journal = journal or Journal()
    attachments = gather_attachments(config.attach, configuration)
    drops, queue = Drops(), FrameQueue()
    wiring = wire(config, host, JournalReporter(journal, drops))
    plan = plan_recording(config, host, wiring, attachments=attachments, name=name)
    recording = Recording(
        FlightWriter(plan, status=_first_status(wiring), at=plan.session.started),
        gauges=_gauges(plan, host, wiring, queue),
        drops=drops,
        journal=journal,
        at=plan.session.started,
    )
    journal.log.info("recording_started", recording=plan.session.recording, directory=str(plan.directory))
    capture = Capture(wiring, queue, drops, stop)
    capture.start()
    ended, paths = _store_all(recording, queue, wiring, stop)
    capture.join(IDLE_S)  # lets a crashed thread print its traceback first; one that hangs is left behind
    dropped = sum(drops.by_reason().values())
    journal.log.info("recording_finished", reason=ended.reason, stored=recording.stored, dropped=dropped)
    _raise_failure(ended)
    return Outcome(plan.session.recording, ended.reason, tuple(paths), recording.stored, dropped)


def _first_status(wiring: Wiring) -> CameraStatus:
    identity = wiring.camera.identity
    return CameraStatus("connected", f"{identity.driver}: {identity.note}" if identity.note else identity.driver)


def _raise_failure(ended: Ended) -> None:
    if ended.error is not None:
        raise ended.error
    if ended.crashed:
        raise RecorderError("The camera's thread crashed; its traceback is above, please report it.")


def _gauges(plan: Plan, host: Host, wiring: Wiring, queue: FrameQueue) -> Gauges:
    return Gauges(
        clock_name=clock_name(wiring),
        free_bytes=lambda: host.free_bytes(plan.directory),
        temperatures_c=lambda: dict(host.temperatures_c()),
        # A camera that waits for the disk fills the queue as the threads happen to run; that is no news about the
        # flight.
        queued=lambda: len(queue) if wiring.live else None,
    )


def _store_all(recording: Recording, queue: FrameQueue, wiring: Wiring, stop: Stop) -> tuple[Ended, list[Path]]:
    try:
        ended = _store_until_end(recording, queue, wiring, stop)
        return ended, recording.finish(ended.reason, ended.at)
    except FlightNotWrittenError:
        stop.request("the disk failed")
        recording.abandon()
        raise


def _store_until_end(recording: Recording, queue: FrameQueue, wiring: Wiring, stop: Stop) -> Ended:
    patience_s = PATIENCE_S
    while True:
        item = queue.take(IDLE_S)
        if isinstance(item, Ended):
            return item
        if isinstance(item, Arrival):
            recording.store(item)
            continue
        if wiring.live:
            recording.tick(wiring.clock.read())
        if stop.is_requested:
            patience_s -= IDLE_S
            if patience_s <= 0:
                return Ended(f"{stop.reason}; the camera did not answer", wiring.clock.read())
