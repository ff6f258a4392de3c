"""The recorder's own expected errors.

    RecorderError
    ├── ConfigurationError       recorder.yaml, or a file it names, is wrong
    ├── ReplayNotPossibleError   the name of what `recorder replay` or `extract` is to make is taken or wrong
    ├── FileNotWrittenError      a file that a command makes cannot be written
    ├── NothingToMarkError       there is no segment to mark
    └── NotMarkedError           the marks cannot be written

Beside these there are flight_file.errors.FlightFileError (the disk) and camera_drivers.errors.CameraError (the
camera). Each message is one sentence that says what to do.
"""

from __future__ import annotations

import errno
from pathlib import Path

MAY_PASS = frozenset(
    (errno.EIO, errno.ENODEV, errno.ESTALE, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.ETIMEDOUT)
)
"""Errors of a disk that fails, or of a system in which something is used up: later it may be otherwise."""


class RecorderError(Exception):
    """Base of everything this package raises on purpose."""


class ConfigurationError(RecorderError):
    """The configuration is wrong; starting again does not help, unless a file could not be read just now."""


class ReplayNotPossibleError(RecorderError):
    """The name of the file to be made is taken or not allowed."""


class FileNotWrittenError(RecorderError):
    """A file cannot be written."""

    def __init__(self, path: Path, error: OSError) -> None:
        super().__init__(f"{path}: cannot be written ({error.strerror or error}); check the folder and its space.")


class NothingToMarkError(RecorderError):
    """There is no segment to mark."""


class NotMarkedError(RecorderError):
    """The operating system does not let us mark a segment."""
