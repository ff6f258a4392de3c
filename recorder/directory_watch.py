"""Notices when a directory is not the one any more that a file was opened in: its disk was pulled out or unmounted.

The open file alone does not tell: a disk that is unmounted lazily takes every byte, and nobody will find them under the
directory's name.
"""

from __future__ import annotations

from pathlib import Path

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading

LOOK_NS = 1_000_000_000


class DirectoryWatch:
    """Looks after one directory."""

    def __init__(self) -> None:
        self._directory: Path | None = None
        self._place = (0, 0)
        self._looked_ns: int | None = None

    def begin(self, directory: Path) -> None:
        """Look after this directory, as it is now; raises as `check` does."""
        self._place = _place(directory)
        self._directory = directory

    def check(self, at: ClockReading) -> None:
        """Look, if it is a second since the last time.

        Raises
        ------
        FlightNotWrittenError
            The directory is gone, or another one is in its place.
        """
        if self._directory is None or (self._looked_ns is not None and at.monotonic_ns - self._looked_ns < LOOK_NS):
            return
        self._looked_ns = at.monotonic_ns
        if _place(self._directory) != self._place:
            raise FlightNotWrittenError(self._directory, reason="is on another disk than before; bring the disk back")


def _place(directory: Path) -> tuple[int, int]:
    try:
        found = directory.stat()
    except OSError as error:
        reason = f"cannot be found ({error.strerror}); bring the disk back"
        raise FlightNotWrittenError(directory, reason=reason) from error
    return found.st_dev, found.st_ino
