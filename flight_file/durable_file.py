"""A file that is written front to back and says when its bytes are safe.

Unbuffered: the MCAP writer hands over whole records, and a failed write must not be tried again by a buffer that is
thrown away.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
from contextlib import suppress
from pathlib import Path

from flight_file.errors import FlightNotWrittenError

FILE_MODE = 0o640  # the operators' group may read recordings, nobody else

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
    """A new file in work, as the stream that an MCAP writer expects; locked until it is closed (see `locks`).

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
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, FILE_MODE)
        except OSError as error:
            raise _not_written(path, error) from error
        self._digest = hashlib.sha256() if digested else None
        # Where a file system has no locks the recording matters more. Somebody who looks whether the file is in work
        # holds the lock for a moment only.
        with suppress(OSError):
            fcntl.flock(self._descriptor, fcntl.LOCK_EX)

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
            if self._digest is not None:
                self._digest.update(view[:done])
        return done

    def tell(self) -> int:
        """Bytes written so far."""
        return self._written_bytes

    def flush(self) -> None:
        """Nothing waits in this process."""

    def sync(self) -> None:
        """Come back when all bytes are on the disk."""
        if self.synced_bytes == self._written_bytes:
            return
        try:
            os.fdatasync(self._descriptor)
        except OSError as error:
            raise _not_written(self.path, error) from error
        self.synced_bytes = self._written_bytes

    def close(self) -> None:
        """Close it as it is; a second time does nothing."""
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            with suppress(OSError):  # what matters was synced, and a descriptor is gone after a failed close too
                os.close(descriptor)

    def discard(self) -> None:
        """Close it and remove it, as far as the disk lets us."""
        self.close()
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


def cut_file(path: Path, size_bytes: int) -> None:
    """Make a file no larger than this, for good; one that is gone is small enough.

    Raises
    ------
    FlightNotWrittenError
        If the disk fails.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    except OSError as error:
        raise _not_written(path, error) from error
    try:
        if os.fstat(descriptor).st_size > size_bytes:
            os.ftruncate(descriptor, size_bytes)
            os.fsync(descriptor)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        os.close(descriptor)


def sync_directory(directory: Path) -> None:
    """Make names in a directory durable: a new or renamed file is there after a power cut only then."""
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise _not_written(directory, error) from error


def refuse_existing(target: Path) -> None:
    """Raise FlightNotWrittenError if there is something under this name, or the disk does not say."""
    try:
        if target.exists():
            raise FlightNotWrittenError(target, reason="exists already; give the recording another name")
    except OSError as error:
        raise _not_written(target, error) from error


def rename_durably(source: Path, target: Path) -> None:
    """Give a file its final name for good; refuses to replace another file."""
    refuse_existing(target)
    try:
        source.rename(target)
    except OSError as error:
        raise _not_written(target, error) from error
    sync_directory(target.parent)


def replace_durably(path: Path, content: bytes) -> None:
    """Write a small file whole, over an older one if there is one; after a power cut it is the old one or the new."""
    aside = path.with_name(path.name + ".new")
    try:
        aside.unlink(missing_ok=True)
    except OSError as error:
        raise _not_written(aside, error) from error
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


def _not_written(path: Path, error: OSError) -> FlightNotWrittenError:
    advice = _ADVICE.get(error.errno or 0, "check the disk and its permissions")
    return FlightNotWrittenError(path, reason=f"cannot be written ({error.strerror}); {advice}")
