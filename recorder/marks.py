"""Marks: segments that retention keeps, whatever the disk has room for.

A mark is a small file beside the segment, `NAME.mcap.keep`, also while the segment is still `NAME.mcap.part`. So
anybody who may write in the directory can set one while the recorder runs, without talking to it, and copy tools can
see it. Each line is one mark: when it was set, and a note.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from flight_file.durable_file import sync_directory
from flight_file.locks import in_work
from flight_file.segments import parse_segment_name
from flight_file.writer import PART_SUFFIX
from recorder.errors import NothingToMarkError, NotMarkedError

MARK_SUFFIX = ".keep"

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MODE = 0o660  # whoever of the operators' group marks, the recorder and the others may read it and add to it


def mark_path(segment: Path) -> Path:
    """Where the mark of a segment lies, finished or in work."""
    return segment.with_name(segment.name.removesuffix(PART_SUFFIX) + MARK_SUFFIX)


def is_marked(segment: Path) -> bool:
    """Whether retention must keep this segment, finished or in work."""
    return mark_path(segment).exists()


def mark(directory: Path, *, note: str, realtime_ns: int) -> list[Path]:
    """Mark the segment in work, or else the newest one, and the one before it; gives both, the older one first.

    Parameters
    ----------
    directory
        Where the recordings lie.
    note
        Why; may be empty.
    realtime_ns
        Now, UTC.

    Raises
    ------
    NothingToMarkError
        There is no segment.
    NotMarkedError
        The directory cannot be listed or written.
    """
    try:
        found = newest_two(directory)
        if not found:
            raise NothingToMarkError(f"{directory}: there is no recording in it; give the recorder's directory.")
        when = _EPOCH + timedelta(microseconds=realtime_ns // 1000)
        line = f"{when:%Y-%m-%dT%H:%M:%SZ} {' '.join(note.split())}".rstrip() + "\n"
        for segment in found:
            _append(mark_path(segment), line.encode())
        sync_directory(directory)
    except OSError as error:
        reason = f"cannot be marked in ({error.strerror}); you must be in the recorder's group to mark"
        raise NotMarkedError(f"{directory}: {reason}.") from error
    return found


def newest_two(directory: Path) -> list[Path]:
    """The segment in work or, if there is none, the one written last; before it, the one that was before it."""
    segments = [path for path in directory.iterdir() if parse_segment_name(path)]
    if not segments:
        return []
    working = [path for path in segments if path.name.endswith(PART_SUFFIX) and in_work(path)]
    newest = max(working or segments, key=_age)
    before = _before(newest, segments)
    return [before, newest] if before is not None else [newest]


def _before(newest: Path, segments: Iterable[Path]) -> Path | None:
    recording, number = parse_segment_name(newest) or ("", 0)
    others = [path for path in segments if path != newest]
    named = [(parse_segment_name(path) or ("", 0), path) for path in others]
    own = [(name[1], path) for name, path in named if name[0] == recording and name[1] < number]
    if own:
        return max(own)[1]
    # The first segment of a recording follows the last one of the recording before: perhaps the power failed between.
    return max(others, key=_age, default=None)


def _age(path: Path) -> tuple[int, str]:
    return path.stat().st_mtime_ns, path.name


def _append(path: Path, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, _MODE)
    try:
        os.write(descriptor, content)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
