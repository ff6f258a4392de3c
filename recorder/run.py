"""Record: from a configuration to flight files.

camera's thread ──> queue (bounded) ──> writer's thread ──> flight files
       └── signs of life ──> main thread <──┘               salvage thread: what an earlier life left behind
                                  └──> systemd
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from flight_file.errors import FlightNotWrittenError
from recorder.assembly import Assembly, in_one_line
from recorder.attachments import gather_attachments
from recorder.camera_reports import CameraReports
from recorder.capture import Capture
from recorder.drivers import Wiring, wire
from recorder.drops import Drops
from recorder.errors import RecorderError
from recorder.evidence import configured_signer
from recorder.frame_queue import Ended, FrameQueue
from recorder.host import Host
from recorder.journal import Journal
from recorder.recording import Recording
from recorder.service_manager import ServiceManager
from recorder.settings import RecorderConfig
from recorder.signs_of_life import SignsOfLife
from recorder.stop import Stop
from recorder.store import Store
from recorder.supervision import Supervision
from recorder.writing import Writing

_CRASH_S = 1.0  # lets a crashed thread print its traceback; one that hangs is left behind


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run has recorded.

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

    A live camera is recorded whatever happens: one that fails is connected again for ever, a disk that fails is tried
    again for ever, and what an earlier life left in work is finished beside it. A replay that runs as fast as it can
    ends with an error if its disk fails.

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
    service
        Who is told how it goes; nobody if not given.

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
    run = _Run.of(
        config, host, stop=stop or Stop(), journal=journal or Journal(), configuration=configuration, name=name
    )
    writing = run.started()
    run.supervise(writing, service or ServiceManager())
    return run.outcome(writing)


@dataclass(frozen=True, slots=True)
class _Run:
    """The parts of one run, which its threads share."""

    wiring: Wiring
    drops: Drops
    queue: FrameQueue
    signs: SignsOfLife
    stop: Stop
    journal: Journal
    store: Store
    recording: Recording

    @classmethod
    def of(
        cls, config: RecorderConfig, host: Host, *, stop: Stop, journal: Journal, configuration: bytes, name: str | None
    ) -> Self:
        """The parts that a configuration asks for; a replay's store is open."""
        attachments = gather_attachments(config.attach, configuration)
        signer = configured_signer(config.evidence)
        drops, queue, signs = Drops(), FrameQueue(), SignsOfLife(host.clock)
        wiring = wire(config, host, CameraReports(queue=queue, drops=drops, signs=signs, clock=host.clock))
        assembly = Assembly(
            config=config, host=host, wiring=wiring, journal=journal, drops=drops, queue=queue, signer=signer
        )
        store = assembly.store(attachments=attachments, name=name, salvager=assembly.salvager())
        start = wiring.clock.read()
        recording = Recording(store, gauges=assembly.gauges(), drops=drops, journal=journal, at=start)
        if not wiring.live:
            store.open(start)  # before the camera turns the clock; a disk that fails now is an error at once
        return cls(wiring, drops, queue, signs, stop, journal, store, recording)

    def started(self) -> Writing:
        """Start the camera's thread and the writer's; gives the writer's."""
        Capture(self.wiring, queue=self.queue, drops=self.drops, signs=self.signs, stop=self.stop).start()
        writing = Writing(
            self.recording, self.store, queue=self.queue, wiring=self.wiring, stop=self.stop, signs=self.signs
        )
        writing.start()
        return writing

    def supervise(self, writing: Writing, service: ServiceManager) -> None:
        """Wait until it is over, and tell `service` how it goes meanwhile."""
        supervision = Supervision(
            stop=self.stop,
            signs=self.signs,
            service=service,
            journal=self.journal,
            describe=lambda: in_one_line(self.store, self.recording, self.drops),
        )
        supervision.wait_for(writing, limited=self.wiring.live)

    def outcome(self, writing: Writing) -> Outcome:
        """What was recorded; raises what the run failed with."""
        ended = self._ended(writing)
        stored, dropped = self.store.stored, self.drops.total
        self.journal.log.info("recording_finished", reason=ended.reason, stored=stored, dropped=dropped)
        if ended.error is not None:
            raise ended.error
        if ended.crashed:
            raise RecorderError("The camera's thread crashed; its traceback is above, please report it.")
        paths = tuple(path for path in self.store.paths if path.exists())
        return Outcome(self.store.recording, ended.reason, paths, stored, dropped)

    def _ended(self, writing: Writing) -> Ended:
        writing.join(_CRASH_S)
        try:
            return writing.result()
        except FlightNotWrittenError as failure:
            lost = self.store.unwritten_frames() + len(self.queue)
            self.journal.log.critical("recording_failed", reason=str(failure), unwritten_frames=lost)
            raise
