"""Which finished segments are deleted to make room, and deleting them.

The oldest go first. Age is counted in hours of recording, from the newest segment back, and the order is that of the
names: neither asks a wall clock, which on a small board may be years off and may be set at any time. Segments without a
picture (a box that waited for its camera) have no age, so that waiting never costs a flight.

Never deleted: the newest `keep_hours`, what is marked (`NAME.mcap.keep` beside it), what is in work (`.part`), and
every file whose name is not one that the recorder gives.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from flight_file.signature import signature_path
from flight_file.topics import CHANNEL_TOPICS, IMAGE_TOPIC
from recorder.journal import Journal
from recorder.marks import MARK_SUFFIX

_OURS = re.compile(
    r"(?P<start>\d{8}T\d{6}Z)(-(?P<copy>\d+))?_(?P<segment>\d{4,})(?P<recovered>\.recovered(-\d+)?)?\.mcap"
)
_IMAGE_CHANNEL = next(number for number, topic in CHANNEL_TOPICS.items() if topic == IMAGE_TOPIC)
_DAMAGE = (McapError, ValueError, KeyError, struct.error, EOFError, OSError)


@dataclass(frozen=True, slots=True)
class Rules:
    """What shall be kept.

    Attributes
    ----------
    reserve_bytes
        Room that shall be free.
    keep_ns
        The newest so many ns of recording are never deleted.
    max_ns
        What is older than this is deleted even if there is room; None to keep it.
    """

    reserve_bytes: int
    keep_ns: int
    max_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Candidate:
    """A finished segment: where, how long (ns), and whether somebody marked it."""

    path: Path
    span_ns: int
    marked: bool


def by_age(names: Sequence[str]) -> list[str]:
    """Those that are names of the recorder's finished segments, the oldest first."""
    found = [(match, name) for name in names if (match := _OURS.fullmatch(name))]
    return [name for match, name in sorted(found, key=lambda pair: _age_key(pair[0]))]


def _age_key(match: re.Match[str]) -> tuple[str, int, int, str]:
    return (match["start"], int(match["copy"] or 1), int(match["segment"]), match["recovered"] or "")


def recorded_ns(path: Path) -> int:
    """How long a finished segment is, by its index; 0 if it has no pictures or its index cannot be read."""
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except _DAMAGE:
        return 0
    if summary is None or summary.statistics is None:
        return 0
    statistics = summary.statistics
    if not statistics.channel_message_counts.get(_IMAGE_CHANNEL):
        return 0
    return max(0, statistics.message_end_time - statistics.message_start_time)


def older_than(candidates: Sequence[Candidate], limit_ns: int) -> list[Candidate]:
    """Those, the oldest first, after which at least so many ns were recorded.

    Parameters
    ----------
    candidates
        All segments, the oldest first.
    """
    old, newer_ns = [], 0
    for candidate in reversed(candidates):
        if newer_ns >= limit_ns:
            old.append(candidate)
        newer_ns += candidate.span_ns
    return old[::-1]


class Retention:
    """Makes room in one directory; used by one thread.

    Parameters
    ----------
    free_bytes
        Room left where a path lies; None if the system does not say, then nothing is deleted for its sake.
    span_ns
        How long a finished segment is.
    """

    def __init__(
        self,
        directory: Path,
        rules: Rules,
        *,
        free_bytes: Callable[[Path], int | None],
        journal: Journal,
        span_ns: Callable[[Path], int] = recorded_ns,
    ) -> None:
        self._directory = directory
        self._rules = rules
        self._free_bytes = free_bytes
        self._journal = journal
        self._read_span_ns = span_ns
        self._spans_ns: dict[str, int] = {}

    def make_room(self, *, disk_is_full: bool = False) -> bool:
        """Delete what must go; says whether anything was.

        Parameters
        ----------
        disk_is_full
            Delete at least one segment, if any may be, whatever the system says is free.
        """
        if not disk_is_full and not self._is_short() and self._rules.max_ns is None:
            return False
        candidates = self._candidates()
        too_old = 0 if self._rules.max_ns is None else len(older_than(candidates, self._rules.max_ns))
        wanted, deleted = disk_is_full, False
        for number, candidate in enumerate(older_than(candidates, self._rules.keep_ns)):
            if candidate.marked:
                continue
            if not (number < too_old or wanted or self._is_short()):
                break
            if not self._delete(candidate.path):
                break  # a disk that does not let us delete one lets us delete none
            wanted, deleted = False, True
        return deleted

    def _is_short(self) -> bool:
        free = self._free_bytes(self._directory)
        return free is not None and free < self._rules.reserve_bytes

    def _candidates(self) -> list[Candidate]:
        try:
            with os.scandir(self._directory) as entries:
                names = [entry.name for entry in entries if entry.is_file(follow_symlinks=False)]
        except OSError:
            return []  # a disk that is gone needs no room; whoever writes to it says so
        marks = {name for name in names if name.endswith(MARK_SUFFIX)}
        ours = by_age(names)
        self._spans_ns = {name: self._spans_ns.get(name, -1) for name in ours}
        return [Candidate(self._directory / name, self._span_ns(name), name + MARK_SUFFIX in marks) for name in ours]

    def _span_ns(self, name: str) -> int:
        if self._spans_ns[name] < 0:
            self._spans_ns[name] = self._read_span_ns(self._directory / name)
        return self._spans_ns[name]

    def _delete(self, path: Path) -> bool:
        # The segment first: a signature without its file is a missing segment, a file without its signature a suspect.
        try:
            path.unlink(missing_ok=True)
            signature_path(path).unlink(missing_ok=True)
        except OSError as error:
            self._journal.log.warning("segment_not_deleted", path=str(path), reason=error.strerror)
            return False
        self._journal.log.info("segment_deleted", path=str(path))
        return True
