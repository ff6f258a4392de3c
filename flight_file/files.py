"""Files that are written sequentially, report when their bytes are safe, and are locked while in work.

Unbuffered: the MCAP writer hands over whole records, and a failed write must not be retried by a buffer that is being
discarded. The recorder holds `flock` on its `.part` from the first byte until the final name; the kernel releases it
when the holder dies, so there is no stale lock.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from flight_file.errors import FlightNotReadableError, FlightNotWrittenError
from flight_file.thresholds import BLOCK_BYTES, MAX_SMALL_BYTES
from flight_file.untrusted import open_regular

FILE_MODE = 0o640  # the operators' group may read recordings, nobody else
_OWN_MODE = 0o600
# Errors of opening a name that leads to somebody else's file, or to none.
_NOT_OURS = (errno.ENOENT, errno.ELOOP, errno.ENXIO, errno.EISDIR, errno.ENOTDIR, errno.EACCES, errno.EPERM)
_ADVICE = {
    errno.EPERM: "check who may write there",
    errno.EACCES: "check who may write there",
    errno.ENOENT: "create the directory first",
    errno.EEXIST: "give the recording another name",
    errno.ENOSPC: "make room on the disk",
    errno.EDQUOT: "raise the quota or make room",
    errno.EROFS: "mount the disk for writing",
}


class DurableFile:
    """A new file in work, as the stream that an MCAP writer expects; locked until it is closed (see `claimed`).

    Parameters
    ----------
    digested
        Whether `sha256` will be asked for.

    Raises
    ------
    FlightNotWrittenError
        From every method that touches the disk.
    """

    def __init__(self, path: Path, *, digested: bool = False) -> None:
        self.path = path
        self.synced_bytes = 0
        self._written_bytes = 0
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, _OWN_MODE)
            self._directory = _identity(path.parent.stat())
        except OSError as error:
            raise _not_written(path, error) from error
        self._digest = hashlib.sha256() if digested else None
        self._head = b""
        # A file system without locks must not prevent the recording. The wait is short: somebody who checks whether the
        # file is in work holds the lock only for a moment.
        with suppress(OSError):
            fcntl.flock(self._descriptor, fcntl.LOCK_EX)
        # Only after locking: anybody who may read the file may lock it, and would keep the recorder waiting.
        with suppress(OSError):
            os.fchmod(self._descriptor, FILE_MODE & ~_umask())

    @property
    def sha256(self) -> str:
        """SHA-256 of everything written so far, hexadecimal; only of a file that was opened as `digested`."""
        if self._digest is None:
            raise ValueError(self.path)
        return self._digest.hexdigest()

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write all of it."""
        view = memoryview(data)
        done = 0
        try:
            while done < len(view):
                done += os.write(self._descriptor, view[done:])
        except OSError as error:
            raise _not_written(self.path, error) from error
        finally:
            self._written_bytes += done
            self._head += view[: min(done, MAX_SMALL_BYTES - len(self._head))].tobytes()
            if self._digest is not None:
                self._digest.update(view[:done])
        return done

    def tell(self) -> int:
        """Bytes written so far."""
        return self._written_bytes

    def flush(self) -> None:
        """Do nothing: no bytes wait in this process."""

    def sync(self) -> None:
        """Wait until all bytes are on the disk."""
        if self.synced_bytes == self._written_bytes:
            return
        try:
            os.fdatasync(self._descriptor)
        except OSError as error:
            raise _not_written(self.path, error) from error
        self.synced_bytes = self._written_bytes

    def rename(self, path: Path) -> None:
        """Rename it durably while it is in work; refuses to replace another file.

        If only making the new name durable fails, it has the new name nevertheless.
        """
        _rename(self.path, path)
        self.path = path
        sync_directory(path.parent)

    def close(self) -> None:
        """Close it as it is; a second time does nothing."""
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            with suppress(OSError):  # all that matters was synced, and a failed close frees the descriptor too
                os.close(descriptor)

    def cut(self) -> bool:
        """Truncate it durably to its synced bytes once it is closed; return False if its name leads to no such file.

        The disk may have been removed and brought back since, so the file is found by its name. That name may lead to
        anything by now, so no link is followed, no pipe waited for, and only a file that begins like this one is cut.
        Its inode would not identify it: some file systems renumber files with each mount.
        """
        try:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY)
        except OSError as error:
            if error.errno in _NOT_OURS:
                return False
            raise _not_written(self.path, error) from error
        try:
            return self._cut(descriptor)
        except OSError as error:
            raise _not_written(self.path, error) from error
        finally:
            os.close(descriptor)

    def _cut(self, descriptor: int) -> bool:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode) or os.pread(descriptor, len(self._head), 0) != self._head:
            return False
        if found.st_size > self.synced_bytes:
            os.ftruncate(descriptor, self.synced_bytes)
            os.fsync(descriptor)
        return True

    @property
    def has_moved(self) -> bool:
        """Whether its folder was replaced or is gone; also true if the disk does not say."""
        try:
            return _identity(self.path.parent.stat()) != self._directory
        except OSError:
            return True

    def discard(self) -> bool:
        """Close and remove it, if the disk allows and its name is still ours; return whether it is certainly gone."""
        gone, out_of_reach = self.is_gone, self.has_moved
        self.close()
        if gone or out_of_reach:
            return gone
        try:
            self.path.unlink(missing_ok=True)
        except OSError:
            return False
        return True

    @property
    def is_gone(self) -> bool:
        """Whether it was deleted, renamed or replaced while open; with a missing disk it is not gone."""
        if self._descriptor < 0:
            return False
        try:
            own = os.fstat(self._descriptor)
            if own.st_nlink and self.has_moved:
                return False
        except OSError:
            return False
        try:
            return not own.st_nlink or _identity(self.path.lstat()) != _identity(own)
        except OSError as error:
            return error.errno == errno.ENOENT

    def refuse_gone(self) -> None:
        """Raise FlightNotWrittenError if it is gone."""
        if self.is_gone:
            reason = "was deleted, renamed or replaced while it was in work; leave files that end in .part alone"
            raise FlightNotWrittenError(self.path, reason=reason)

    def save_as(self, path: Path) -> None:
        """Copy its synced bytes durably into another file, even if its own name is gone."""
        copy = DurableFile(path)
        try:
            for offset in range(0, self.synced_bytes, BLOCK_BYTES):
                copy.write(os.pread(self._descriptor, min(BLOCK_BYTES, self.synced_bytes - offset), offset))
            copy.sync()
            sync_directory(path.parent)
        except OSError as error:
            copy.discard()
            raise _not_written(path, error) from error
        except FlightNotWrittenError:
            copy.discard()
            raise
        finally:
            copy.close()


def sync_directory(directory: Path) -> None:
    """Make the names in a directory durable, as after creating or renaming a file."""
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise _not_written(directory, error) from error


def is_there(path: Path) -> bool:
    """Whether the name exists, if only as a link that leads nowhere; raises FlightNotWrittenError if the disk fails."""
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    except OSError as error:
        raise _not_written(path, error) from error
    return True


def refuse_existing(target: Path) -> None:
    """Raise FlightNotWrittenError if the name exists, or the disk does not say."""
    if not is_there(target):
        return
    raise FlightNotWrittenError(target, reason="exists already; give the recording another name")


def rename_durably(source: Path, target: Path) -> None:
    """Rename a file durably; refuses to replace another file."""
    _rename(source, target)
    sync_directory(target.parent)


def _rename(source: Path, target: Path) -> None:
    refuse_existing(target)
    try:
        source.rename(target)
    except OSError as error:
        raise _not_written(target, error) from error


def free_aside(path: Path, suffix: str) -> Path:
    """Return a free name beside a file, for content that is to become that file.

    A file of this name was left by an interrupted write and is removed. Anything but a file belongs to somebody else:
    it stays, and the name gets a number.
    """
    names = (path.with_name(f"{path.name}{suffix}{'' if number == 1 else f'-{number}'}") for number in count(1))
    for name in names:
        try:
            if not stat.S_ISREG(name.lstat().st_mode):
                continue
            name.unlink()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise _not_written(name, error) from error
        return name
    raise AssertionError(path)


def replace_durably(path: Path, content: bytes) -> None:
    """Replace a small file atomically: after a power cut it is the old one or the new."""
    aside = free_aside(path, ".new")
    file = DurableFile(aside)
    try:
        file.write(content)
        file.sync()
        aside.replace(path)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        file.close()
    sync_directory(path.parent)


def _umask() -> int:
    """Read the umask; `os.umask` would change it for all threads. Raises OSError where the system does not tell."""
    with Path("/proc/self/status").open(encoding="ascii", errors="replace") as lines:
        found = next((line for line in lines if line.startswith("Umask:")), "Umask: 077")
    return int(found.split()[1], 8)


def _identity(found: os.stat_result) -> tuple[int, int]:
    return found.st_dev, found.st_ino


def _not_written(path: Path, error: OSError) -> FlightNotWrittenError:
    advice = _ADVICE.get(error.errno or 0, "check the disk and its permissions")
    return FlightNotWrittenError(path, reason=f"cannot be written ({error.strerror}); {advice}")


@contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Lock a file inside the `with` block; yields False at once if another process has it in work.

    Only the right to read the file is needed.

    Raises
    ------
    FlightNotReadableError
        If the file is not there, may not be read, is no regular file, or its file system knows no locks.
    """
    try:
        descriptor = open_regular(path)
    except OSError as error:
        raise FlightNotReadableError(path, reason=f"cannot be opened ({error.strerror}); check its name") from error
    try:
        yield _lock(descriptor, path)
    finally:
        os.close(descriptor)


def in_work(path: Path) -> bool:
    """Whether a process has the file in work; a missing file is not, nor is a link, a pipe or a folder.

    Raises
    ------
    FlightNotReadableError
        If it may not be read.
    """
    with suppress(FileNotFoundError):
        if stat.S_ISREG(path.lstat().st_mode):
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
    # Its last holder may have renamed it to its final name meanwhile.
    with suppress(OSError):
        return path.stat().st_ino == os.fstat(descriptor).st_ino
    return False
