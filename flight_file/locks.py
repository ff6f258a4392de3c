"""Who has a file in work: the recorder holds `flock` on its `.part` from its first byte until it has its final name.

The kernel gives up the lock when its holder dies, however it dies: there is no stale lock.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from flight_file.errors import FlightNotReadableError


@contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Take a file for oneself inside the `with` block; says False, at once, if somebody else has it in work.

    Needs the right to read the file, no more.

    Raises
    ------
    FlightNotReadableError
        If the file is not there, may not be read, or its file system knows no locks.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise FlightNotReadableError(path, reason=f"cannot be opened ({error.strerror}); check its name") from error
    try:
        yield _lock(descriptor, path)
    finally:
        os.close(descriptor)


def in_work(path: Path) -> bool:
    """Whether somebody has the file in work; a file that is gone is in nobody's work.

    Raises
    ------
    FlightNotReadableError
        If it may not be read.
    """
    with suppress(FileNotFoundError):
        path.stat()
        with claimed(path) as ours:
            return not ours
    return False


def _lock(descriptor: int, path: Path) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        reason = f"cannot be locked ({error.strerror}); copy it to another disk"
        raise FlightNotReadableError(path, reason=reason) from error
    # Whoever had it before may have given it its final name meanwhile.
    with suppress(OSError):
        return path.stat().st_ino == os.fstat(descriptor).st_ino
    return False
