"""`recorder run`: record, from a configuration to flight files.

camera's thread ──> queue (bounded) ──> writer's thread ──> flight files
       └── signs of life ──> main thread <──┘               salvage thread: what an earlier life left behind
                                  └──> systemd
"""

from __future__ import annotations

import faulthandler
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import click

from flight_file.errors import FlightNotWrittenError
from flight_file.flight_writer import Plan
from flight_file.frame import NS_PER_S, CameraStatus
from flight_file.salvage import recover_segment
from flight_file.signature import Signer
from flight_file.summary import Recorded
from flight_file.untrusted import say
from recorder.capture import CameraReports, Capture, Wiring, wire
from recorder.cli import failures_as_sentences
from recorder.config import RecorderConfig, load_config
from recorder.errors import RecorderError
from recorder.frame_queue import Drops, Ended, FrameQueue
from recorder.host import Host, hold_standard_descriptors, share_one_heap, this_host
from recorder.housekeeping import Retention, Rules, Salvager, files_in_work, recovery_in_words
from recorder.journal import Journal
from recorder.plan import clock_name, configured_signer, gather_attachments, plan_recording, refuse_wrong_directory
from recorder.segment_store import SegmentStore
from recorder.supervision import Heartbeats, ServiceManager, Stop, Supervision, stop_on_signals
from recorder.thresholds import LONGER_S, SILENCE_S, TICK_S
from recorder.writer_thread import Gauges, Recording, WriterThread

_NS_PER_HOUR = 3600 * NS_PER_S


@dataclass(frozen=True, slots=True)
class Assembly:
    """Builds the parts of one recording."""

    config: RecorderConfig
    host: Host
    wiring: Wiring
    journal: Journal
    drops: Drops
    queue: FrameQueue
    signer: Signer | None
    waiting: dict[str, Recorded] = field(default_factory=dict)
    """Files left in work that wait for room, from the salvage's thread to the writer's."""

    def store(self, *, attachments: Mapping[str, bytes], name: str | None, salvager: Salvager | None) -> SegmentStore:
        """Make the store that everything goes to.

        Parameters
        ----------
        attachments
            What the configuration attaches.
        name
            Of the recording; its start time if None.
        salvager
            Gets the files left in work; None to leave them alone.
        """

        def plan() -> Plan:
            made = plan_recording(
                self.config, self.host, self.wiring, attachments=attachments, name=name, signer=self.signer
            )
            for path in files_in_work(made.directory) if salvager else []:
                left_behind(path)
            return made

        def left_behind(path: Path) -> None:
            if salvager is not None:
                salvager.submit(path)

        return SegmentStore(
            plan,
            status=self._first_status(),
            retention=self._retention(),
            retries_forever=self.wiring.live,
            drops=self.drops,
            journal=self.journal,
            left_behind=left_behind,
        )

    def salvager(self) -> Salvager | None:
        """Start the thread that finishes what is left in work; None for a fast replay."""
        if not self.wiring.live:
            return None

        def recover(path: Path) -> str:
            recovery = recover_segment(path, at=self.host.clock.read(), signer=self.signer)
            return recovery_in_words(recovery, is_signing=self.signer is not None)

        salvager = Salvager(recover, free_bytes=self.host.free_bytes, journal=self.journal, waiting=self.waiting)
        salvager.start()
        return salvager

    def gauges(self) -> Gauges:
        """Connect the values of the health reports."""
        live = self.wiring.live
        return Gauges(
            clock_state=self.host.clock_state if live else lambda: clock_name(self.wiring),
            free_bytes=lambda: self.host.free_bytes(self.config.storage.directory),
            temperatures_c=lambda: dict(self.host.temperatures_c()),
            # If the camera waits for the disk, how full the queue is depends only on how the threads happen to run.
            queued=lambda: len(self.queue) if live else None,
        )

    def rules(self) -> Rules:
        """Say what the retention is to keep."""
        storage = self.config.storage
        return Rules(
            reserve_bytes=round(storage.keep_free_gib * 2**30),
            keep_ns=round(storage.keep_hours * _NS_PER_HOUR),
            longest_ns=round((storage.segment_s + LONGER_S) * NS_PER_S),
            picture_ns=round(max(SILENCE_S, getattr(self.config.camera, "interval_s", 0.0)) * NS_PER_S),
            max_ns=None if storage.max_hours is None else round(storage.max_hours * _NS_PER_HOUR),
        )

    def _retention(self) -> Retention:
        return Retention(
            self.config.storage.directory,
            self.rules(),
            free_bytes=self.host.free_bytes,
            journal=self.journal,
            waiting=self.waiting,
        )

    def _first_status(self) -> CameraStatus:
        identity = self.wiring.camera.identity
        words = f"{identity.driver}: {identity.note}" if identity.note else identity.driver
        return CameraStatus("connecting" if self.wiring.live else "connected", words)


def in_one_line(store: SegmentStore, recording: Recording, drops: Drops) -> str:
    """Summarize the recording in a line, for `systemctl status`."""
    trouble, status = store.trouble, store.status
    if trouble is not None:
        return f"The disk fails, the newest pictures wait in memory: {trouble.failure}"
    lost = f", {drops.total} lost" if drops.total else ""
    kept = f", {store.unreadable} unreadable files kept" if store.unreadable else ""
    why = f" ({status.reason})" if status.reason else ""
    return f"{store.stored} pictures stored, {recording.rate_hz:.1f} Hz{lost}{kept}; camera {status.state}{why}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a run.

    Attributes
    ----------
    reason
        Why it ended.
    paths
        The finished segments that are still there, in order.
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
    service: ServiceManager | None = None,
) -> Outcome:
    """Record until the camera has no more pictures or somebody asks to stop.

    A live camera is recorded whatever happens: a failed camera is connected again and a failed disk tried again without
    limit, and files left in work by an earlier run are finished meanwhile. A replay that runs as fast as it can ends
    with an error if its disk fails.

    Everything that differs from run to run comes through `host`: with `recorder.host.fixed_host` and `pace:
    fastest`, recording the same pictures twice gives the same bytes. A fast replay runs on a clock that begins with
    the first picture's own time and jumps from picture to picture, so the recording's name and its log times are those
    of the pictures.

    Parameters
    ----------
    config
        From `recorder.config.load_config` or `parse_config`.
    host
        The machine; `recorder.host.this_host()` or `recorder.host.fixed_host(clock)`.
    stop
        To end the run from elsewhere.
    journal
        Where the log goes; stderr if not given.
    configuration
        Bytes of recorder.yaml, carried as an attachment; empty for none.
    name
        Of the recording; its start time if not given. A name that is taken gets a number.
    service
        Is told the progress; nobody if not given.

    Raises
    ------
    ConfigurationError
        The configuration cannot be carried out.
    CameraError
        The replay failed; what it gave before is stored and the files are closed.
    FlightNotWrittenError
        The disk failed; what was synced before stays, in a file that ends in `.part`.
    RecorderError
        The camera's thread crashed; what it gave before is stored and the files are closed. Or a disk that hangs kept
        the recording from ending in time.
    """
    log = journal or Journal()
    try:
        run = _Run.of(config, host, stop=stop or Stop(), journal=log, configuration=configuration, name=name)
        writing = run.started()
        run.supervise(writing, service or ServiceManager())
        return run.outcome(writing)
    finally:
        log.settle()


@dataclass(frozen=True, slots=True)
class _Run:
    """The parts of one run, which its threads share."""

    wiring: Wiring
    drops: Drops
    queue: FrameQueue
    heartbeats: Heartbeats
    stop: Stop
    journal: Journal
    store: SegmentStore
    recording: Recording

    @classmethod
    def of(
        cls, config: RecorderConfig, host: Host, *, stop: Stop, journal: Journal, configuration: bytes, name: str | None
    ) -> Self:
        """Build the parts that a configuration asks for; a replay's store is already open."""
        refuse_wrong_directory(config.storage.directory)
        attachments = gather_attachments(config.attach, configuration)
        signer = configured_signer(config.evidence)
        drops, queue, heartbeats = Drops(), FrameQueue(), Heartbeats(host.clock)
        wiring = wire(config, host, CameraReports(queue=queue, drops=drops, heartbeats=heartbeats, clock=host.clock))
        assembly = Assembly(
            config=config, host=host, wiring=wiring, journal=journal, drops=drops, queue=queue, signer=signer
        )
        store = assembly.store(attachments=attachments, name=name, salvager=assembly.salvager())
        start = wiring.clock.read()
        recording = Recording(store, gauges=assembly.gauges(), drops=drops, journal=journal, at=start)
        if not wiring.live:
            store.open(start)  # before the camera turns the clock; a disk that fails now is an error at once
        return cls(wiring, drops, queue, heartbeats, stop, journal, store, recording)

    def started(self) -> WriterThread:
        """Start the camera's thread and the writer's; return the writer's."""
        Capture(self.wiring, queue=self.queue, drops=self.drops, heartbeats=self.heartbeats, stop=self.stop).start()
        writing = WriterThread(
            self.recording, self.store, queue=self.queue, wiring=self.wiring, stop=self.stop, heartbeats=self.heartbeats
        )
        writing.start()
        return writing

    def supervise(self, writing: WriterThread, service: ServiceManager) -> None:
        """Wait until it is over, and tell `service` how it goes meanwhile."""
        supervision = Supervision(
            stop=self.stop,
            heartbeats=self.heartbeats,
            service=service,
            journal=self.journal,
            describe=lambda: in_one_line(self.store, self.recording, self.drops),
        )
        supervision.wait_for(writing.done, limited=self.wiring.live)

    def outcome(self, writing: WriterThread) -> Outcome:
        """Return what was recorded; raise what the run failed with."""
        ended = self._ended(writing)
        stored, dropped = self.store.stored, self.drops.total
        self.journal.log.info("recording_finished", reason=ended.reason, stored=stored, dropped=dropped)
        if ended.error is not None:
            raise ended.error
        if ended.crashed:
            raise RecorderError("The camera's thread crashed; its traceback is above, please report it.")
        paths = tuple(path for path in self.store.paths if path.exists())
        return Outcome(self.store.recording, ended.reason, paths, stored, dropped)

    def _ended(self, writing: WriterThread) -> Ended:
        writing.join(TICK_S)
        try:
            return writing.result()
        except (FlightNotWrittenError, RecorderError) as failure:
            lost = self.store.unwritten_frames() + len(self.queue)
            self.journal.log.critical("recording_failed", reason=str(failure), unwritten_frames=lost)
            raise


@click.command(
    epilog="""\b
Examples:
  recorder run --config /etc/recorder/recorder.yaml
  recorder run --config replay.yaml && decode flights/*.mcap

\b
A minimal replay.yaml:
  camera: {driver: replay, path: pictures/, rate_hz: 4, pace: fastest}
  storage: {directory: flights/}""",
)
@click.option(
    "--config",
    "config_path",
    type=click.Path(path_type=Path),
    required=True,
    help="The recorder.yaml to follow; paths in it are relative to it.",
)
def run(config_path: Path) -> None:
    """Record in the foreground, until SIGTERM or Ctrl-C, or until a replay has no more pictures.

    The finished segments are listed on stdout; the log goes to stderr as JSON lines.
    """
    hold_standard_descriptors()
    share_one_heap()
    with failures_as_sentences():
        config, configuration = load_config(config_path)
        stop = Stop()
        stop_on_signals(stop)
        faulthandler.enable(2)  # the watchdog's SIGABRT then leaves in the log where each thread hung
        outcome = record(
            config,
            host=this_host(),
            stop=stop,
            configuration=configuration,
            service=ServiceManager.from_environment(os.environ),
        )
    for path in outcome.paths:
        say(str(path))
