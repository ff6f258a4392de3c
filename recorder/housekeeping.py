"""Looks after the segments in the directory: deletes the oldest to make room, and finishes those left in work.

The oldest go first. Age is counted in hours of recording, from the newest segment back, and the order is that of the
names: neither depends on a wall clock, which on a small board may be years off and may be set at any time. No picture
counts for more than `SILENCE_S`, or than the camera's interval if that is longer, so neither a box that waited for its
camera nor a file of few pictures that claims to be long makes a flight look old. The number of pictures is taken from
the file's own statistics.

Some files are never deleted: the newest `keep_hours`, of this recording and of any that another recorder has in work;
marked segments (see `marks`); files in work; files with names that the recorder does not give; and files with such a
name that cannot be read as a segment, or claim to be longer than one can be. The last count no hours and are named in
the log. A file that the system refuses to delete is named there too, and skipped. Frames that a recovery set apart
(`.unproven`) are as old as their segment, and kept by its mark.

Segments are left in work by an earlier run of the recorder, or by a disk that failed; they are finished in the
background. A segment that there is no room to finish is as old as its name says, and deleted in its turn; otherwise
each power cut on a full disk would leave one more, until nothing else had room.
"""

from __future__ import annotations

import errno
import os
import queue
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from flight_file.errors import FlightFileError, FlightNotWrittenError, NotAFlightError
from flight_file.files import claimed
from flight_file.frame import NS_PER_S
from flight_file.records import DamagedRecordError
from flight_file.salvage import Outcome, Recovery
from flight_file.session import BEGUN_SUFFIX, PART_SUFFIX, claimed_place
from flight_file.signature import signature_path
from flight_file.summary import Recorded, recorded, recorded_so_far
from flight_file.untrusted import regular_names
from recorder.errors import MAY_PASS
from recorder.journal import Journal
from recorder.marks import MARKS_FOLDER, Marks, is_in_work, tidy_marks
from recorder.thresholds import LOOKS, NAMED_AT_ONCE, READS_AT_ONCE, SALVAGE_AGAIN_S, SAY_S, SILENCE_S

_OURS = re.compile(
    r"(?P<start>\d{8}T\d{6}Z)(-(?P<copy>\d+))?_(?P<segment>\d{4,})(?P<recovered>\.recovered(-\d+)?)?\.mcap"
    r"(?P<unproven>\.unproven(-\d+)?)?",
    re.ASCII,
)
_Age = tuple[str, int, int, str]
Recover = Callable[[Path], str]
"""Finishes one file in work; says in words what became of it, and raises FlightFileError."""
FULL = (errno.ENOSPC, errno.EDQUOT)
_ALL_REFUSED = (errno.EROFS, errno.EIO)  # a disk that refuses one deletion so refuses all
_LATER = MAY_PASS | {errno.EROFS}
_IN_WORK = (PART_SUFFIX, BEGUN_SUFFIX)
_NICE = 10  # the camera and the disk go first


@dataclass(frozen=True, slots=True)
class Rules:
    """What is to be kept.

    Attributes
    ----------
    reserve_bytes
        Free space to be kept.
    keep_ns
        The newest recordings of this length, ns, are never deleted.
    longest_ns
        No segment is longer than this; a file that claims to be is not believed.
    max_ns
        Older segments are deleted even if there is room; None to keep them.
    picture_ns
        No picture counts for more than this.
    """

    reserve_bytes: int
    keep_ns: int
    longest_ns: int
    max_ns: int | None = None
    picture_ns: int = round(SILENCE_S * NS_PER_S)


def by_age(names: Iterable[str]) -> list[str]:
    """Sort the names of the recorder's finished segments by age, oldest first; drop other names."""
    return [name for _, name in sorted(_aged(names))]


def _aged(names: Iterable[str]) -> Iterator[tuple[_Age, str]]:
    for name in names:
        if match := _OURS.fullmatch(name):
            copy, segment = int(match["copy"] or 1), int(match["segment"])
            what = (match["recovered"] or "") + (match["unproven"] or "")
            yield (match["start"], copy, segment, what), name


def older_than(names: Sequence[str], limit_ns: int, span_ns: Callable[[str], int | None]) -> Sequence[str]:
    """Return the names of segments followed by at least `limit_ns` of recording, as far as known.

    Parameters
    ----------
    names
        Of all segments, the oldest first; so is the result.
    span_ns
        Returns a segment's length, None if not known yet; called only for segments that are not older.
    """
    newer_ns = 0
    for count in range(len(names), 0, -1):
        if newer_ns >= limit_ns:
            return names[:count]
        span = span_ns(names[count - 1])
        if span is None:
            break
        newer_ns += span
    return ()


class _SegmentIndex:
    """The finished segments in a directory, and how long each is, as far as it is known.

    Files that were there the last time are not read again: with hundreds of thousands that would take too long.

    Attributes
    ----------
    names
        Of everything in the directory.
    unreadable
        Those that have a segment's name, but cannot be read as one or are not to be believed.
    """

    def __init__(
        self, read: Callable[[Path], Recorded], waiting: Mapping[str, Recorded], rules: Rules, journal: Journal
    ) -> None:
        self._read = read
        self._waiting = waiting
        self._rules = rules
        self._journal = journal
        self._directory = Path()
        self._segments: list[tuple[_Age, str]] = []
        self._spans_ns: dict[str, int] = {}
        self._reads_left = 0
        self._until_s = 0.0
        self._unsaid: list[str] = []
        self.names: set[str] = set()
        self.unreadable: set[str] = set()

    def take(self, directory: Path) -> list[str]:
        """List the segments that may be readable, oldest first; raises OSError."""
        with os.scandir(directory) as entries:
            names = {entry.name for entry in entries}
        gone, new = self.names - names, names - self.names
        self._spans_ns = {name: span_ns for name, span_ns in self._spans_ns.items() if name not in gone}
        self.unreadable -= gone
        left_out = gone | self.unreadable
        kept = (aged for aged in self._segments if aged[1] not in left_out)
        self._segments = sorted([*kept, *_aged(new)])
        self._directory, self.names, self._reads_left = directory, names, READS_AT_ONCE
        self._until_s = monotonic() + SAY_S
        waiting = {name.removesuffix(PART_SUFFIX): name for name in tuple(self._waiting) if name in names - left_out}
        in_work = ((age, waiting[name]) for age, name in _aged(waiting))
        return [name for _, name in sorted([*self._segments, *in_work])]

    @property
    def is_late(self) -> bool:
        """Whether the look takes long, as on a slow disk: the writer's thread has to go on, and looks again later."""
        return monotonic() >= self._until_s

    def span_ns(self, name: str) -> int | None:
        """Return the length that a segment counts, ns: 0 if unreadable, None if there is no time to look now."""
        if name in self.unreadable:
            return 0
        if name not in self._spans_ns and self._reads_left and not self.is_late:
            self._reads_left -= 1
            try:
                waiting = self._waiting.get(name)
                found = self._read(self._directory / name) if waiting is None else waiting
            except (OSError, DamagedRecordError):
                found = None
            if found is None or found.span_ns > self._rules.longest_ns:
                self.unreadable.add(name)
                self._unsaid.append(name)
                return 0
            self._spans_ns[name] = min(found.span_ns, found.pictures * self._rules.picture_ns)
        return self._spans_ns.get(name)

    def say_unreadable(self) -> None:
        """Log the unreadable files not logged before."""
        if self._unsaid:
            count, named = len(self._unsaid), sorted(self._unsaid[:NAMED_AT_ONCE])
            self._unsaid.clear()
            where = str(self._directory)
            self._journal.log.warning("segments_unreadable", count=count, directory=where, names=named, became="kept")


class Retention:
    """Deletes segments to make room in one directory; used by one thread.

    Parameters
    ----------
    waiting
        Names of files left in work that there is no room to finish, and what is in each: see `Salvager`.
    free_bytes
        Free bytes on the file system of a path; None if the system does not say, then no file is deleted to free space.
    read
        Reads the statistics of a finished segment; raises OSError or DamagedRecordError where it cannot be read.
    """

    def __init__(
        self,
        directory: Path,
        rules: Rules,
        *,
        free_bytes: Callable[[Path], int | None],
        journal: Journal,
        waiting: MutableMapping[str, Recorded] | None = None,
        read: Callable[[Path], Recorded] = recorded,
    ) -> None:
        self.directory = directory
        self._rules = rules
        self._free_bytes = free_bytes
        self._journal = journal
        self._waiting = {} if waiting is None else waiting
        self._index = _SegmentIndex(read, self._waiting, rules, journal)
        self._said: set[str] = set()
        self._refused: set[str] = set()
        self._in_work: dict[str, int] = {}  # recordings, and for how many looks each still counts as in work

    @property
    def unreadable(self) -> int:
        """Number of files examined so far that have a segment's name but cannot be read as one."""
        return len(self._index.unreadable)

    def make_room(self, *, disk_is_full: bool = False) -> bool:
        """Delete what must go; return whether anything was deleted.

        Parameters
        ----------
        disk_is_full
            Delete at least one segment, if allowed, however much the system says is free.
        """
        self._tidy_marks()
        if not disk_is_full and not self._is_short() and self._rules.max_ns is None:
            return False
        try:
            segments = self._index.take(self.directory)
        except OSError:
            return False  # a disk that is gone needs no room; the writer reports it
        try:
            with Marks(self.directory, self._index.names) as marks:
                deleted = self._delete_oldest(segments, marks, disk_is_full=disk_is_full)
        except OSError as error:
            if self._is_new("marks_unknown"):
                self._journal.log.warning("marks_unknown", directory=str(self.directory), reason=error.strerror)
            return False
        self._said.discard("marks_unknown")
        self._index.say_unreadable()
        return deleted

    def _tidy_marks(self) -> None:
        tidied, where = tidy_marks(self.directory), str(self.directory / MARKS_FOLDER)
        for path in tidied.emptied:
            self._journal.log.warning("mark_too_large", path=str(path))
        if tidied.unusable and self._is_new("marks_unusable"):
            self._journal.log.error("marks_unusable", path=where, reason=tidied.unusable)
        if tidied.strange and self._is_new("marks_strange"):
            named = sorted(tidied.strange)[:NAMED_AT_ONCE]
            self._journal.log.warning("marks_strange", path=where, count=len(tidied.strange), names=named)

    def _is_new(self, what: str) -> bool:
        """Whether this has not been said before; it has been afterwards."""
        is_new = what not in self._said
        self._said.add(what)
        return is_new

    def _delete_oldest(self, segments: Sequence[str], marks: Marks, *, disk_is_full: bool) -> bool:
        span_ns = self._index.span_ns
        too_old = 0 if self._rules.max_ns is None else len(older_than(segments, self._rules.max_ns, span_ns))
        wanted, deleted = disk_is_full, False
        refused: dict[str, OSError] = {}
        newest_in_work = self._newest_in_work(segments)
        for number, name in enumerate(older_than(segments, self._rules.keep_ns, span_ns)):
            if name in newest_in_work or marks.keep(name):
                continue
            if not (number < too_old or wanted or self._is_short()) or (deleted and self._index.is_late):
                break
            if span_ns(name) is None:
                break
            if name in self._index.unreadable:
                continue
            try:
                if self._delete(self.directory / name):
                    wanted, deleted = False, True
            except OSError as error:
                refused[name] = error
                if error.errno in _ALL_REFUSED:
                    break
        self._say_refused(refused)
        return deleted

    def _newest_in_work(self, segments: Sequence[str]) -> set[str]:
        """Return the newest segments, `keep_ns` of them, of each recording that some recorder has in work.

        If two recorders share a directory, the one that was started first gives older names to segments that may be
        newer. Between two segments it has no file in work, so each recording is remembered for some more looks.
        """
        self._in_work = {recording: looks - 1 for recording, looks in self._in_work.items() if looks > 1}
        for name in (name for name in self._index.names if name.endswith(_IN_WORK) and name not in self._waiting):
            place = claimed_place(Path(name.removesuffix(BEGUN_SUFFIX)))
            if place is not None and is_in_work(self.directory / name):
                self._in_work[place[0]] = LOOKS
        newest: set[str] = set()
        for recording in self._in_work:
            own = [name for name in segments if name.startswith(f"{recording}_")]
            newest.update(own[len(older_than(own, self._rules.keep_ns, self._index.span_ns)) :])
        return newest

    def _is_short(self) -> bool:
        free = self._free_bytes(self.directory)
        return free is not None and free < self._rules.reserve_bytes

    def _delete(self, path: Path) -> bool:
        if path.name.endswith(PART_SUFFIX):
            return self._delete_in_work(path)
        # The segment first: a signature without its file shows a missing segment, a file without one looks suspicious.
        path.unlink(missing_ok=True)
        self._journal.log.info("segment_deleted", path=str(path))
        signature = signature_path(path)
        try:
            signature.unlink(missing_ok=True)
        except OSError as error:  # the room was made; to report a failure would cost one more segment
            self._journal.log.warning("signature_not_deleted", path=str(signature), reason=error.strerror)
        return True

    def _delete_in_work(self, path: Path) -> bool:
        with suppress(FlightFileError), claimed(path) as ours:
            if ours:
                path.unlink()
                self._waiting.pop(path.name, None)
                self._journal.log.info("segment_deleted", path=str(path))
                return True
        return False

    def _say_refused(self, refused: Mapping[str, OSError]) -> None:
        """Log what could not be deleted, each name once; it is tried again each time."""
        new = sorted(refused.keys() - self._refused)
        self._refused = (self._refused | refused.keys()) & self._index.names
        if new:
            reason, where = refused[new[0]].strerror, str(self.directory)
            named = new[:NAMED_AT_ONCE]
            self._journal.log.warning(
                "segments_not_deleted", count=len(new), directory=where, names=named, reason=reason
            )


def recovery_in_words(recovery: Recovery, *, is_signing: bool) -> str:
    """Say what became of a file, for the log.

    Parameters
    ----------
    is_signing
        Whether there was a key to sign with.
    """
    words = [recovery.outcome.value]
    if is_signing and recovery.outcome in (Outcome.RECOVERED, Outcome.FINISHED):
        words.append("signed" if recovery.signed else "not signed: nothing in it proves that this box recorded it")
    if recovery.unproven is not None:
        words.append(f"{recovery.unproven_frames} frame(s) that nothing proves are in {recovery.unproven.name}")
    return ", ".join(words)


def files_in_work(directory: Path) -> list[Path]:
    """List the segments in work in a directory, regular files only; empty if it cannot be listed."""
    with suppress(OSError):
        paths = [directory / name for name in regular_names(directory) if name.endswith(PART_SUFFIX)]
        return [path for path in paths if claimed_place(path)]
    return []


class Salvager(threading.Thread):
    """Recovers one file after another, in a daemon thread: a recovery that is cut off can be repeated.

    Parameters
    ----------
    free_bytes
        Room left where a path lies, bytes; None if unknown.
    waiting
        Gets the names of files that there is no room for, and what is in each; retention may take them out.
    """

    def __init__(
        self,
        recover: Recover,
        *,
        free_bytes: Callable[[Path], int | None],
        journal: Journal,
        waiting: MutableMapping[str, Recorded],
    ) -> None:
        super().__init__(name="salvage", daemon=True)
        self._recover = recover
        self._free_bytes = free_bytes
        self._journal = journal
        self._paths: queue.SimpleQueue[Path] = queue.SimpleQueue()
        self._waiting = waiting
        self._postponed: list[Path] = []

    def submit(self, path: Path) -> None:
        """Queue a file for recovery."""
        self._paths.put(path)

    def run(self) -> None:
        """Recover queued files until the process ends."""
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        while True:
            try:
                path = self._paths.get(timeout=SALVAGE_AGAIN_S)
            except queue.Empty:
                self._try_postponed()
            else:
                self._salvage(path)

    def _try_postponed(self) -> None:
        postponed, self._postponed = self._postponed, []
        for path in postponed:
            if not _is_gone(path):  # it may have been deleted to make room
                self._salvage(path)

    def _salvage(self, path: Path) -> None:
        try:
            became = self._recovered(path)
            if became is None:
                self._wait_for_room(path)
                return
            self._waiting.pop(path.name, None)
        except FlightFileError as error:
            if isinstance(error.__cause__, OSError) and error.__cause__.errno in _LATER:
                self._postponed.append(path)
            self._journal.log.warning("segment_not_salvaged", path=str(path), reason=str(error))
            return
        except OSError as error:
            if not isinstance(error, FileNotFoundError):
                self._postponed.append(path)
            self._journal.log.warning("segment_not_salvaged", path=str(path), reason=error.strerror)
            return
        except MemoryError:  # said below: here its traceback still holds on to what filled the memory
            pass
        else:
            self._journal.log.warning("segment_salvaged", path=str(path), became=became)
            return
        reason = "it holds records that are larger than the memory; recover it on another machine"
        self._journal.log.warning("segment_not_salvaged", path=str(path), reason=reason)

    def _recovered(self, path: Path) -> str | None:
        """Recover a file; return what became of it, None if there is no room for that, or the quota is used up."""
        if not self._has_room(path):
            return None
        try:
            return self._recover(path)
        except FlightNotWrittenError as error:
            if isinstance(error.__cause__, OSError) and error.__cause__.errno in FULL:
                return None
            raise

    def _wait_for_room(self, path: Path) -> None:
        self._postponed.append(path)
        with suppress(NotAFlightError):
            self._waiting[path.name] = recorded_so_far(path)
        self._journal.log.warning("segment_not_salvaged", path=str(path), reason="there is no room for it now")

    def _has_room(self, path: Path) -> bool:
        # The copy needs as much room as the file has, and recording goes on meanwhile: require twice as much. A file in
        # work can be read as it is, so no flight may be deleted to finish it. While it waits, it ages like any other.
        free = self._free_bytes(path.parent)
        return free is None or free >= 2 * path.stat().st_size


def _is_gone(path: Path) -> bool:
    """Whether nothing has this name; if the disk does not say, assume that it is still there."""
    try:
        path.lstat()
    except OSError as error:
        return isinstance(error, FileNotFoundError)
    return False
