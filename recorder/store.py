"""Gets what is recorded onto the disk, whatever the disk does meanwhile.

    open ──write fails──> in trouble ──try again: soon, then less often──> open, with a new segment
                              full disk: the oldest segments go first

What was given but is not on the disk for certain is kept (8 MiB or a second of it, see `flight_file.writer`) and
written again into the new segment; the old one is cut to what is certain. So each frame is there once. While there is
trouble nothing is taken from the queue, which keeps the newest frames.
"""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from flight_file.durable_file import cut_file
from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading, Frame
from flight_file.log_clock import LogClock
from flight_file.reports import CameraStatus
from flight_file.segments import FlightWriter, Plan
from flight_file.writer import Remains
from recorder.back_off import BackOff, Pace
from recorder.directory_watch import DirectoryWatch
from recorder.drops import Drops
from recorder.journal import Journal
from recorder.plan import with_free_number
from recorder.recorded import Recorded, Remark, write
from recorder.retention import Retention

PACE = Pace(first_s=1.0, longest_s=15.0)

_FULL = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True, slots=True)
class Trouble:
    """Why nothing can be written, since when, and when to try again (monotonic, ns)."""

    failure: FlightNotWrittenError
    since: ClockReading
    again_ns: int


class Store:
    """A flight writer that survives its disk.

    Parameters
    ----------
    make_plan
        Called when the first segment is opened.
    endures
        Whether to keep trying, for ever. Otherwise a disk that fails is an error, unless it is full of old segments.
    left_behind
        Called with each file in work that had to be given up, when its disk is back.

    Raises
    ------
    FlightNotWrittenError
        From every method, if it does not endure.
    """

    def __init__(
        self,
        make_plan: Callable[[], Plan],
        *,
        status: CameraStatus,
        retention: Retention,
        endures: bool,
        drops: Drops,
        journal: Journal,
        left_behind: Callable[[Path], None],
    ) -> None:
        self._make_plan = make_plan
        self._plan: Plan | None = None
        self._status = status
        self._retention = retention
        self._endures = endures
        self._drops = drops
        self._journal = journal
        self._left_behind = left_behind
        self._log_clock = LogClock()
        self._watch = DirectoryWatch()
        self._writer: FlightWriter | None = None
        self._pending: deque[tuple[Recorded, ClockReading]] = deque()
        self._handed = 0  # how many of these, the first, the writer has
        self._remains: Remains | None = None
        self._back_off = BackOff()
        self._started = False
        self.trouble: Trouble | None = None
        self.recording = ""
        self.stored = 0
        self.paths: list[Path] = []

    @property
    def is_open(self) -> bool:
        """Whether there is a segment in work."""
        return self._writer is not None

    @property
    def status(self) -> CameraStatus:
        """The last one, with which a new segment begins."""
        return self._status

    def open(self, at: ClockReading) -> bool:
        """Open the first segment, or a new one after trouble, if it is time to try; says whether one is open."""
        if self._writer is None and (self.trouble is None or at.monotonic_ns >= self.trouble.again_ns):
            try:
                self._open(at)
            except FlightNotWrittenError as failure:
                self._in_trouble(failure, at)
        self._hand_over(at)
        return self.is_open

    def try_now(self, at: ClockReading) -> bool:
        """Like `open`, but without waiting any longer."""
        if self.trouble is not None:
            self.trouble = replace(self.trouble, again_ns=at.monotonic_ns)
        return self.open(at)

    def put(self, what: Recorded, at: ClockReading) -> None:
        """Store something; it is kept while nothing can be written."""
        if isinstance(what, CameraStatus):
            self._status = what
        self._pending.append((what, at))
        self.stored += isinstance(what, Frame)
        self._hand_over(at)

    def remark(self, reason: str, at: ClockReading) -> None:
        """Store that something happened which does not change the camera's state."""
        self.put(Remark(replace(self._status, reason=reason, dropped=self._drops.total)), at)

    def tick(self, at: ClockReading) -> None:
        """Do what is due while no frames come."""
        self._attempt(lambda writer: writer.tick(at), at)

    def make_room(self) -> None:
        """Let the retention do what is due."""
        self._retention.make_room()

    def name_camera(self, *, model: str, serial: str) -> None:
        """Say in the segments to come which camera it is."""
        if self._plan is not None:
            session = replace(self._plan.session, camera_model=model, camera_serial=serial)
            self._plan = replace(self._plan, session=session)
        if self._writer is not None:
            self._writer.name_camera(model=model, serial=serial)

    def finish(self, reason: str, at: ClockReading) -> None:
        """Close the last segment; after a failure a new one is tried once, and then it is an error."""
        self._attempt(lambda writer: writer.finish(reason, at), at)
        if self.trouble is not None and self.try_now(at):
            self._attempt(lambda writer: writer.finish(reason, at), at)
        if self.trouble is not None:
            raise self.trouble.failure
        self._writer = None

    def unwritten_frames(self) -> int:
        """Frames that were given but are not on the disk for certain."""
        return sum(isinstance(what, Frame) for what, _ in self._pending)

    def abandon(self) -> None:
        """Leave everything as it is; for use after an error."""
        if self._writer is not None:
            self._writer.abandon()

    def _open(self, at: ClockReading) -> None:
        if self._plan is None:
            self._plan = self._make_plan()
            self.recording = self._plan.session.recording
        self._retention.make_room()
        if self._endures:
            self._watch.begin(self._plan.directory)
            self._plan = with_free_number(self._plan)
        if self._remains is not None and self._remains.path is not None:
            cut_file(self._remains.path, self._remains.synced_bytes)
        self._writer = FlightWriter(self._plan, status=self._status, at=at, log_clock=self._log_clock)
        if not self._started:
            self._started = True
            self._journal.log.info("recording_started", recording=self.recording, directory=str(self._plan.directory))
        if self._remains is not None and self._remains.path is not None:
            self._left_behind(self._remains.path)
        self._remains = None

    def _hand_over(self, at: ClockReading) -> None:
        self._attempt(lambda _: self._watch.check(at), at)
        while self._writer is not None and self._handed < len(self._pending):
            self._attempt(self._write_next, at)
        if self.trouble is not None:
            # A full disk may have room for the head of a segment, but not for what waits: only a sync tells.
            self._attempt(lambda writer: writer.sync(at), at)
            if self._writer is not None:
                self._trouble_is_over(self.trouble, at)

    def _trouble_is_over(self, trouble: Trouble, at: ClockReading) -> None:
        self.trouble = None
        self._back_off.reset()
        self._drops.blame_disk("")
        seconds = (at.monotonic_ns - trouble.since.monotonic_ns) / 1e9
        self._journal.log.warning("disk_back", after_s=round(seconds, 1))
        reason = f"the disk can be written again after {seconds:.1f} s; before: {trouble.failure}"
        self.remark(reason, at)

    def _write_next(self, writer: FlightWriter) -> None:
        what, when = self._pending[self._handed]
        if isinstance(what, Frame):
            writer.make_room(when, len(what.jpeg))
        self._handed += 1
        write(writer, what, when)

    def _attempt(self, action: Callable[[FlightWriter], object], at: ClockReading) -> None:
        writer = self._writer
        if writer is None:
            return
        try:
            action(writer)
        except FlightNotWrittenError as failure:
            self._forget_synced(writer)
            self._in_trouble(failure, at)
            self._set_aside(writer)
        else:
            self._forget_synced(writer)
            if writer.finished:
                self._collect(writer)
                self._retention.make_room()

    def _in_trouble(self, failure: FlightNotWrittenError, at: ClockReading) -> None:
        """Plan the next attempt; raises the failure if there shall be none."""
        freed = _strerror_and_number(failure)[1] in _FULL and self._retention.make_room(disk_is_full=True)
        if not self._endures and not freed:
            raise failure
        wait_ns = 0 if freed else self._back_off.next_ns(PACE)
        if self.trouble is None:
            self._journal.log.error("disk_failed", reason=str(failure))
        since = at if self.trouble is None else self.trouble.since
        self.trouble = Trouble(failure, since, at.monotonic_ns + wait_ns)
        self._drops.blame_disk(f"the disk could not be written ({_strerror_and_number(failure)[0]})")

    def _set_aside(self, writer: FlightWriter) -> None:
        self._collect(writer)
        self._remains = writer.remains()
        self._writer, self._handed = None, 0
        if self._plan is not None:
            session = replace(self._plan.session, segment=self._remains.segment, chain=self._remains.chain)
            self._plan = replace(self._plan, session=session)

    def _forget_synced(self, writer: FlightWriter) -> None:
        for _ in range(self._handed - writer.unsynced):
            self._pending.popleft()
        self._handed = min(self._handed, writer.unsynced)

    def _collect(self, writer: FlightWriter) -> None:
        self.paths += writer.finished
        writer.finished.clear()


def _strerror_and_number(failure: FlightNotWrittenError) -> tuple[str, int]:
    cause = failure.__cause__
    return (cause.strerror or "", cause.errno or 0) if isinstance(cause, OSError) else (failure.reason, 0)
