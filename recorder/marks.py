"""Marks: segments that retention keeps, whatever the disk has room for.

A mark is a small file in the folder `marks` beside the segments, `marks/NAME.mcap.keep`, also while the segment is
still `NAME.mcap.part`. So anyone who may write in that folder can set one while the recorder runs, without contacting
it and without the right to change a recording. Each line is one mark: when it was set, and a note.

A segment's mark also keeps what a recovery made of it: the last frames before a power cut may be in
`NAME.mcap.unproven`.

Only the existence of the name counts. Retention does not open marks, so a link, a pipe or a file as large as the disk
in this folder keeps a segment and does nothing else; `tidy_marks` empties a mark larger than any mark should be. Marks
beside the segment, as older recorders set them, count too.

The folder is opened once for each use, without following a link, and everything in it is reached through that
descriptor, so a link in its place leads nowhere. Files in it that are not marks are left alone, even in a folder that
existed before the recorder.

`recorder mark` sets one.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Self

import click

from flight_file.errors import FlightFileError
from flight_file.files import in_work
from flight_file.session import PART_SUFFIX, claimed_place, parse_segment_name, segment_path
from flight_file.untrusted import regular_names, say
from recorder.cli import failures_as_sentences
from recorder.errors import NothingToMarkError, NotMarkedError
from recorder.host import SystemClock
from recorder.thresholds import MARK_BYTES, READS_AT_ONCE

MARK_SUFFIX = ".keep"
MARKS_FOLDER = "marks"
# Errors of opening a folder that does not exist or is somebody else's: the recorder can always read its own.
_NO_FOLDER = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.EACCES, errno.EPERM)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TRIES = 5
_FOLDER_MODE = 0o1770  # the operators' group may add marks; nobody may remove another's
_MODE = 0o660  # the recorder and the whole operators' group may read a mark and add to it


@dataclass(frozen=True, slots=True)
class Tidied:
    """What was found in the folder for marks.

    Attributes
    ----------
    emptied
        Marks that were larger than any mark; they are empty now, and still marks.
    strange
        Names of files that are not marks; they are left alone.
    unusable
        Why the folder could not be looked through; empty if it could, or there is none.
    """

    emptied: tuple[Path, ...] = ()
    strange: tuple[str, ...] = ()
    unusable: str = ""


def names_that_keep(file: str) -> tuple[str, ...]:
    """Return the names whose mark keeps this file, finished or in work: its own, and that of the segment it is of."""
    own = file.removesuffix(PART_SUFFIX)
    place = claimed_place(Path(own))
    return (own,) if place is None else (own, segment_path(Path(), *place).name)


def is_marked(segment: Path) -> bool:
    """Whether retention must keep this segment, finished or in work."""
    names = [name + MARK_SUFFIX for name in names_that_keep(segment.name)]
    if any(os.path.lexists(segment.parent / name) for name in names):
        return True
    with suppress(OSError), _opened_folder(segment.parent) as folder, os.scandir(folder) as entries:
        return any(entry.name in names for entry in entries)
    return False


class Marks:
    """The marks in a directory, looked up one by one: listing a folder that a stranger has filled may take for ever.

    Parameters
    ----------
    beside
        The names in the directory itself.

    Raises
    ------
    OSError
        From every method, if it cannot be found out what is marked.
    """

    def __init__(self, directory: Path, beside: Container[str]) -> None:
        self._beside = beside
        self._folder: int | None = None
        try:
            self._folder = _open_folder(directory)
        except OSError as error:
            if error.errno not in _NO_FOLDER:
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        if self._folder is not None:
            os.close(self._folder)

    def keep(self, file: str) -> bool:
        """Whether a mark keeps this file, finished or in work."""
        return any(self._is_there(name + MARK_SUFFIX) for name in names_that_keep(file))

    def _is_there(self, mark: str) -> bool:
        if mark in self._beside:
            return True
        try:
            return self._folder is not None and bool(os.stat(mark, dir_fd=self._folder, follow_symlinks=False))
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENAMETOOLONG):
                raise
            return False


def make_marks_folder(directory: Path) -> None:
    """Make the folder for marks where it is missing; raises OSError."""
    with suppress(FileExistsError):
        (directory / MARKS_FOLDER).mkdir()
        with _opened_folder(directory) as folder:
            _permit(folder, _FOLDER_MODE)


def tidy_marks(directory: Path) -> Tidied:
    """Empty marks that are larger than any should be, and find files that are no marks; of very many only the first."""
    emptied: list[Path] = []
    strange: list[str] = []
    try:
        with _opened_folder(directory) as folder, os.scandir(folder) as entries:
            for entry in islice(entries, READS_AT_ONCE):
                if not _is_mark(entry.name):
                    strange.append(entry.name)
                elif entry.is_file(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_size > MARK_BYTES:
                    os.unlink(entry.name, dir_fd=folder)
                    os.close(_new_mark(entry.name, folder))
                    emptied.append(directory / MARKS_FOLDER / entry.name)
    except FileNotFoundError:  # there is no folder, or somebody was faster
        pass
    except OSError as error:
        return Tidied(tuple(emptied), tuple(strange), error.strerror or str(error))
    return Tidied(tuple(emptied), tuple(strange))


def _mark_name(segment: Path) -> str:
    return segment.name.removesuffix(PART_SUFFIX) + MARK_SUFFIX


def _is_mark(name: str) -> bool:
    return name.endswith(MARK_SUFFIX) and claimed_place(Path(name.removesuffix(MARK_SUFFIX))) is not None


@contextmanager
def _opened_folder(directory: Path) -> Iterator[int]:
    """Open the folder for marks itself, never what a link in its place leads to; raises OSError."""
    folder = _open_folder(directory)
    try:
        yield folder
    finally:
        os.close(folder)


def _open_folder(directory: Path) -> int:
    return os.open(directory / MARKS_FOLDER, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)


def mark_newest(directory: Path, *, note: str, realtime_ns: int) -> list[Path]:
    """Mark the segment in work, or else the newest, and the one before it; return both, older first.

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
        The directory cannot be listed or written, or the marks found room there, but not the note.
    """
    try:
        found = newest_two(directory)
    except OSError as error:
        reason = f"cannot be listed ({error.strerror})"
        raise NotMarkedError(f"{directory}: {reason}; give the recorder's directory, or join its group.") from error
    if not found:
        raise NothingToMarkError(f"{directory}: there is no recording in it; give the recorder's directory.")
    try:
        when = _EPOCH + timedelta(microseconds=realtime_ns // 1000)
        make_marks_folder(directory)
        line = f"{when:%Y-%m-%dT%H:%M:%SZ} {' '.join(note.split())}".rstrip() + "\n"
        with _opened_folder(directory) as folder:
            # All marks first: on a full disk a name may find room where a note does not, and it is the name that keeps.
            marks = [_opened_mark(_mark_name(segment), folder) for segment in found]
            os.fsync(folder)
    except OSError as error:
        reason = f"no recording in it can be marked ({error.strerror})"
        advice = "make room, join the recorder's group, or remove `marks` if it is no folder"
        raise NotMarkedError(f"{directory}: {reason}; {advice}.") from error
    try:
        for mark in marks:
            _append(mark, line.encode())
    except OSError as error:
        names = " and ".join(path.name for path in found)
        raise NotMarkedError(f"{names} will be kept, but without the note ({error.strerror}); make room.") from error
    finally:
        for mark in marks:
            os.close(mark)
    return found


def newest_two(directory: Path) -> list[Path]:
    """Find the segment in work, or else the one written last, preceded by the one before it."""
    for _ in range(_TRIES):
        segments = [path for name in regular_names(directory) if parse_segment_name(path := directory / name)]
        with suppress(FileNotFoundError):  # one was finished or deleted since
            return _newest_two(segments)
    raise FileNotFoundError(errno.ENOENT, "its segments change too fast")


def _newest_two(segments: list[Path]) -> list[Path]:
    if not segments:
        return []
    working = [path for path in segments if path.name.endswith(PART_SUFFIX) and is_in_work(path)]
    newest = max(working or segments, key=_age)
    before = _before(newest, segments)
    return [before, newest] if before is not None else [newest]


def is_in_work(path: Path) -> bool:
    """Whether a process has a segment in work, as far as this one may look."""
    with suppress(FlightFileError):  # all who may mark may read the recorder's own file
        return in_work(path)
    return False


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


# Others with access to the folder may have put a link or a pipe there: it is neither followed nor waited for.
_APPENDING = os.O_WRONLY | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


def _opened_mark(name: str, folder: int) -> int:
    # An existing file is opened without O_CREAT: in a sticky folder the kernel refuses that for a file of another user.
    try:
        return os.open(name, _APPENDING, dir_fd=folder)
    except FileNotFoundError:
        return _new_mark(name, folder)


def _append(mark: int, content: bytes) -> None:
    if os.write(mark, content) < len(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    os.fsync(mark)


def _new_mark(name: str, folder: int) -> int:
    descriptor = os.open(name, _APPENDING | os.O_CREAT | os.O_EXCL, _MODE, dir_fd=folder)
    _permit(descriptor, _MODE)
    return descriptor


def _permit(descriptor: int, mode: int) -> None:
    """Give a new file or folder these rights, some of which the umask may have removed; a memory stick has none."""
    with suppress(PermissionError):
        os.fchmod(descriptor, mode)


@click.command(
    epilog="""\b
Examples:
  recorder mark --config /etc/recorder/recorder.yaml "bird strike"
  recorder mark --directory /var/lib/recorder""",
)
@click.option("--directory", type=click.Path(path_type=Path), help="Where the recordings lie.")
@click.option(
    "--config", "config_path", type=click.Path(path_type=Path), help="The recorder.yaml that says where they lie."
)
@click.argument("note", default="")
def mark(directory: Path | None, config_path: Path | None, note: str) -> None:
    """Keep what was just recorded: the segment in work or the newest, and the one before.

    The recorder never deletes a marked segment. NOTE says why it was marked. To unmark, delete the file
    marks/NAME.mcap.keep.
    """
    if (directory is None) == (config_path is None):
        raise click.UsageError("Give either --directory or --config.")
    with failures_as_sentences():
        where = directory if directory is not None else _configured(config_path)
        for path in mark_newest(where, note=note, realtime_ns=SystemClock().read().realtime_ns):
            say(f"{path.name} will be kept")


def _configured(config_path: Path | None) -> Path:
    # Reading a configuration takes longer than everything else here; with --directory nobody waits for it.
    from recorder.config import load_config  # noqa: PLC0415

    if config_path is None:
        raise TypeError(config_path)
    return load_config(config_path)[0].storage.directory
