"""Stores what is recorded, through failures of the disk.

    open ──write fails──> in trouble ──try again: soon, then less often──> open, with a new segment
                              full disk: the oldest segments go first
                              no memory, even after a wait: the largest waiting frame is dropped and counted

Data that are not certain to be on the disk are kept in memory (8 MiB or a second of them, see `flight_file.writer`) and
written again into the new segment; the old one is cut to what is certain, so that each frame is stored once. A file in
work that somebody deletes, renames or replaces is still open: it gets a name again before the new segment begins. The
directory is made again if somebody deleted it, but not if its disk is missing. While the disk fails, nothing is taken
from the queue, which keeps the newest frames.

The open file itself does not show that it is out of reach: a lazily unmounted disk accepts every byte, and so does a
deleted file. `DirectoryWatch` therefore looks at the directory.
"""

from __future__ import annotations

import errno
import itertools
import os
import stat
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from flight_file.errors import FlightNotWrittenError
from flight_file.files import DurableFile, is_there
from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import NS_PER_S, CameraStatus, ClockReading, Frame, Health, LogClock, LogLine
from flight_file.session import PART_SUFFIX, SEGMENT_SUFFIX
from flight_file.writer import Remains
from recorder.frame_queue import DELETED, NO_MEMORY, Drops
from recorder.housekeeping import FULL, Retention
from recorder.journal import Journal
from recorder.marks import make_marks_folder
from recorder.plan import with_free_name, with_free_number
from recorder.supervision import BackOff
from recorder.thresholds import DISK_AGAIN_S, TICK_S


class DirectoryWatch:
    """Watches one directory."""

    def __init__(self) -> None:
        self._directory: Path | None = None
        self._found: os.stat_result | None = None
        self._parent: os.stat_result | None = None
        self._looked_ns: int | None = None

    def begin(self, directory: Path) -> None:
        """Watch this directory from now on, made again if it was watched and somebody deleted it; raises as `check`."""
        if self._found is not None and self._parent is not None and not is_there(directory):
            _make_again(directory, self._found, self._parent)
        self._found, self._parent = _found(directory), _found(directory.parent)
        self._directory = directory

    def check(self, at: ClockReading, refuse_gone: Callable[[], None]) -> None:
        """Look again if the last look was `TICK_S` ago.

        Parameters
        ----------
        refuse_gone
            Checks the file in work in this directory.

        Raises
        ------
        FlightNotWrittenError
            The directory is gone, or another one is in its place; or what `refuse_gone` raises.
        """
        if (
            self._directory is None
            or self._found is None
            or (self._looked_ns is not None and at.monotonic_ns - self._looked_ns < TICK_S * NS_PER_S)
        ):
            return
        self._looked_ns = at.monotonic_ns
        if not os.path.samestat(_found(self._directory), self._found):
            raise FlightNotWrittenError(self._directory, reason="is on another disk than before; bring the disk back")
        refuse_gone()


def _found(directory: Path) -> os.stat_result:
    try:
        return directory.stat()
    except OSError as error:
        reason = f"cannot be found ({error.strerror}); bring the disk back"
        raise FlightNotWrittenError(directory, reason=reason) from error


def _make_again(directory: Path, found: os.stat_result, parent: os.stat_result) -> None:
    """Make a deleted directory again as it was; but not if its disk is missing, since that may come back."""
    if found.st_dev != parent.st_dev or not os.path.samestat(_found(directory.parent), parent):
        return
    try:
        directory.mkdir()
        with suppress(PermissionError):
            os.chown(directory, -1, found.st_gid)
        directory.chmod(stat.S_IMODE(found.st_mode))
        make_marks_folder(directory)
    except OSError as error:
        reason = f"cannot be made again ({error.strerror}); make it"
        raise FlightNotWrittenError(directory, reason=reason) from error


@dataclass(frozen=True, slots=True)
class Remark:
    """An event worth a line in the flight that does not change the camera's state."""

    status: CameraStatus


Entry = Frame | CameraStatus | Remark | Health | LogLine


_WRITE: Mapping[type, Callable[[FlightWriter, Any, ClockReading], None]] = {
    Frame: FlightWriter.write_frame,
    CameraStatus: FlightWriter.write_status,
    Remark: lambda writer, remark, at: writer.write_remark(remark.status, at),
    Health: FlightWriter.write_health,
    LogLine: FlightWriter.write_log,
}


def write(writer: FlightWriter, what: Entry, at: ClockReading) -> None:
    """Write an entry by its kind; raises FlightNotWrittenError."""
    _WRITE[type(what)](writer, what, at)


@dataclass(frozen=True, slots=True)
class DiskFailure:
    """Why nothing can be written, since when, and when to try again (monotonic, ns)."""

    failure: FlightNotWrittenError
    since: ClockReading
    again_ns: int


class SegmentStore:
    """A flight writer that survives its disk.

    Parameters
    ----------
    make_plan
        Called when the first segment is opened.
    retries_forever
        Whether to retry without limit. Otherwise a disk that fails is an error, unless it is full of old segments.
    left_behind
        Called with each file in work that had to be given up, when its disk is back.

    Raises
    ------
    FlightNotWrittenError
        From every method, unless it retries without limit.
    """

    def __init__(
        self,
        make_plan: Callable[[], Plan],
        *,
        status: CameraStatus,
        retention: Retention,
        retries_forever: bool,
        drops: Drops,
        journal: Journal,
        left_behind: Callable[[Path], None],
    ) -> None:
        self._make_plan = make_plan
        self._plan: Plan | None = None
        self._status = status
        self._retention = retention
        self._retries_forever = retries_forever
        self._drops = drops
        self._journal = journal
        self._left_behind = left_behind
        self._log_clock = LogClock()
        self._watch = DirectoryWatch()
        self._writer: FlightWriter | None = None
        self._pending: deque[tuple[Entry, ClockReading]] = deque()
        self._handed = 0  # how many of these, the first, the writer has
        self._remains: Remains | None = None
        self._left: list[Path] = []
        self._back_off = BackOff()
        self._started = False
        self.is_finished = False
        self.trouble: DiskFailure | None = None
        self.recording = ""
        self.stored = 0
        self.accepted = 0  # like `stored`, but what is lost later stays counted
        self.paths: list[Path] = []

    @property
    def is_open(self) -> bool:
        """Whether there is a segment in work."""
        return self._writer is not None

    @property
    def unreadable(self) -> int:
        """Files among the segments that cannot be read as one; they are kept."""
        return self._retention.unreadable

    @property
    def status(self) -> CameraStatus:
        """The last status, with which a new segment begins."""
        return self._status

    def open(self, at: ClockReading) -> bool:
        """Open the first segment, or a new one after a failure if it is time to retry; return whether one is open."""
        if self._writer is None and (self.trouble is None or at.monotonic_ns >= self.trouble.again_ns):
            failure = self._failed_with(lambda: self._open(at))
            if failure is not None:
                self._in_trouble(failure, at)
        self._hand_over(at)
        return self.is_open

    def try_now(self, at: ClockReading) -> bool:
        """Like `open`, but without waiting any longer."""
        if self.trouble is not None:
            self.trouble = replace(self.trouble, again_ns=at.monotonic_ns)
        return self.open(at)

    def put(self, what: Entry, at: ClockReading) -> None:
        """Store something; it is kept while nothing can be written."""
        if isinstance(what, CameraStatus):
            self._status = what
        self._pending.append((what, at))
        self.stored += isinstance(what, Frame)
        self.accepted += isinstance(what, Frame)
        self._hand_over(at)

    def remark(self, reason: str, at: ClockReading) -> None:
        """Store that something happened which does not change the camera's state."""
        self.put(Remark(replace(self._status, reason=reason, dropped=self._drops.total)), at)

    def tick(self, at: ClockReading) -> None:
        """Check the directory and let the writer sync; to be called while no frames come."""
        self._check_place(at)
        self._attempt(lambda writer: writer.tick(at), at)

    def make_room(self) -> None:
        """Let the retention delete what is due."""
        self._retention.make_room()

    def name_camera(self, *, model: str, serial: str) -> None:
        """Name the camera in the segments to come."""
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
        self._writer, self.is_finished = None, True

    def unwritten_frames(self) -> int:
        """Count the frames that are not certain to be on the disk."""
        remains = self._remains
        gone = remains.frames if remains is not None and remains.file is not None and remains.file.is_gone else 0
        return gone + sum(isinstance(what, Frame) for what, _ in self._pending)

    def abandon(self) -> None:
        """Leave everything as it is; for use after an error."""
        if self._writer is not None:
            self._writer.abandon()

    def _open(self, at: ClockReading) -> None:
        if self._plan is None:
            self._plan = self._make_plan()
        self._retention.make_room()
        if self._retries_forever:
            self._watch.begin(self._plan.directory)
            self._plan = with_free_number(self._plan) if self._started else with_free_name(self._plan)
        if self._remains is not None:
            self._settle(self._remains)
            self._remains = None
        self._writer = FlightWriter(self._plan, status=self._status, at=at, log_clock=self._log_clock)
        if not self._started:
            self._started = True
            self.recording = self._plan.session.recording
            self._journal.log.info("recording_started", recording=self.recording, directory=str(self._plan.directory))
        while self._left:
            self._left_behind(self._left.pop())

    def _hand_over(self, at: ClockReading) -> None:
        self._check_place(at)
        while self._writer is not None and self._handed < len(self._pending):
            self._attempt(self._write_next, at)
        if self.trouble is not None:
            # A full disk may have room for a segment's head, but not for the waiting data: only a sync shows that.
            self._attempt(lambda writer: writer.sync(at), at)
            if self._writer is not None:
                self._trouble_is_over(self.trouble, at)

    def _check_place(self, at: ClockReading) -> None:
        self._attempt(lambda writer: self._watch.check(at, writer.refuse_gone), at)

    def _trouble_is_over(self, trouble: DiskFailure, at: ClockReading) -> None:
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
            writer.make_room(when, len(what.encoded))
        self._handed += 1
        write(writer, what, when)

    def _attempt(self, action: Callable[[FlightWriter], object], at: ClockReading) -> None:
        writer = self._writer
        if writer is None:
            return
        failure = self._failed_with(lambda: action(writer))
        self._forget_synced(writer)
        if failure is None:
            if writer.finished:
                self._collect(writer)
                self._retention.make_room()
            return
        if self.trouble is not None and _lacks_memory(failure) and _lacks_memory(self.trouble.failure):
            self._drop_largest()
        self._in_trouble(failure, at, may_go_on=writer.is_gone)
        self._set_aside(writer)

    def _failed_with(self, action: Callable[[], object]) -> FlightNotWrittenError | None:
        """Do what needs the disk and memory; return what it failed with, if only trying again may help."""
        try:
            action()
        except FlightNotWrittenError as failure:
            return failure
        except MemoryError:  # not kept: its traceback holds on to what filled the memory
            why = os.strerror(errno.ENOMEM)
        else:
            return None
        reason = f"cannot be written ({why}); set smaller pictures, or end other programs"
        lacking = FlightNotWrittenError(self._retention.directory, reason=reason)
        lacking.__cause__ = OSError(errno.ENOMEM, why)
        return lacking

    def _drop_largest(self) -> None:
        """Drop the largest frame that the writer got: it may be one for which there is never enough memory."""
        handed = (what for what, _ in itertools.islice(self._pending, self._handed))
        sizes = {place: len(what.encoded) for place, what in enumerate(handed) if isinstance(what, Frame)}
        if sizes:
            del self._pending[max(sizes, key=sizes.__getitem__)]
            self._handed -= 1
            self.stored -= 1
            self._drops.add(NO_MEMORY)

    def _in_trouble(self, failure: FlightNotWrittenError, at: ClockReading, *, may_go_on: bool = False) -> None:
        """Schedule the next attempt, at once if the disk `may_go_on`; raise the failure if there is to be none."""
        freed = _strerror_and_number(failure)[1] in FULL and self._retention.make_room(disk_is_full=True)
        if not self._retries_forever and not freed:
            raise failure
        wait_ns = 0 if freed or may_go_on else self._back_off.next_ns(DISK_AGAIN_S)
        if self.trouble is None:
            self._journal.log.error("disk_failed", reason=str(failure))
        since = at if self.trouble is None else self.trouble.since
        self.trouble = DiskFailure(failure, since, at.monotonic_ns + wait_ns)
        self._drops.blame_disk(f"the disk could not be written ({_strerror_and_number(failure)[0]})")

    def _set_aside(self, writer: FlightWriter) -> None:
        self._collect(writer)
        self._remains = writer.remains()
        self._writer, self._handed = None, 0
        if self._plan is not None:
            session = replace(self._plan.session, segment=self._remains.segment, chain=self._remains.chain)
            self._plan = replace(self._plan, session=session)

    def _settle(self, remains: Remains) -> None:
        """Leave behind a file with exactly the frames that are on the disk; count them as lost if that fails."""
        file = remains.file
        if file is None:
            return
        if file.is_gone:
            self._bring_back(file, remains.frames)
        elif file.cut():
            self._left.append(file.path)
        elif file.has_moved or is_there(file.path.with_suffix("")):
            # The disk that it is on, or whoever finished it, still has its frames.
            self._journal.log.warning("segment_out_of_reach", path=str(file.path), frames=remains.frames)
        else:
            self._lose(file.path, remains.frames, "it is not there any more, or something else has its name")

    def _bring_back(self, file: DurableFile, frames: int) -> None:
        """Give a file that was deleted or renamed a name again; count its frames as lost where that fails."""
        path = next(path for path in _names_for(file.path) if not is_there(path))
        try:
            file.save_as(path)
        except FlightNotWrittenError as failure:
            self._lose(file.path, frames, str(failure))
        else:
            self._journal.log.warning("segment_brought_back", path=str(path), frames=frames)
            self._left.append(path)
        finally:
            file.close()

    def _lose(self, path: Path, frames: int, reason: str) -> None:
        self.stored -= frames
        self._drops.add(DELETED, frames)
        self._journal.log.error("segment_lost", path=str(path), frames=frames, reason=reason)

    def _forget_synced(self, writer: FlightWriter) -> None:
        for _ in range(self._handed - writer.unsynced):
            self._pending.popleft()
        self._handed = min(self._handed, writer.unsynced)

    def _collect(self, writer: FlightWriter) -> None:
        self.paths += writer.finished
        writer.finished.clear()


def _names_for(part: Path) -> Iterator[Path]:
    """Iterate over the names for a file in work: its own, then those of recovered ones."""
    yield part
    stem = part.name.removesuffix(SEGMENT_SUFFIX + PART_SUFFIX)
    for number in itertools.count(1):
        recovered = ".recovered" if number == 1 else f".recovered-{number}"
        yield part.with_name(stem + recovered + SEGMENT_SUFFIX + PART_SUFFIX)


def _lacks_memory(failure: FlightNotWrittenError) -> bool:
    return _strerror_and_number(failure)[1] == errno.ENOMEM


def _strerror_and_number(failure: FlightNotWrittenError) -> tuple[str, int]:
    cause = failure.__cause__
    return (cause.strerror or "", cause.errno or 0) if isinstance(cause, OSError) else (failure.reason, 0)
