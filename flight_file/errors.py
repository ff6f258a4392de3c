"""Everything that can be expected to go wrong with a flight file.

    FlightFileError
    ├── FlightNotReadableError     no such file, a directory, no permission, a read error
    ├── NotAFlightError            not MCAP, empty, or cut before anything was recorded
    ├── MixedFlightsError          the files given are not the segments of one recording
    ├── FlightNotWrittenError      no permission, disk full, or the name is taken
    ├── NothingToRecoverError      a damaged file in which no recorded byte is left
    └── KeyFileError               a file that should hold a key does not, or cannot be made

Each message is one sentence that says what to do. Damage *inside* a file is no error: it is a `Loss` that the reader
reports.
"""

from __future__ import annotations

from pathlib import Path


class FlightFileError(Exception):
    """Base of everything this package raises on purpose."""


class _PathError(FlightFileError):
    """A failure that belongs to one path."""

    def __init__(self, path: Path, *, reason: str) -> None:
        super().__init__(f"{path}: {reason}.")
        self.path = path
        self.reason = reason


class FlightNotReadableError(_PathError):
    """The operating system does not let us read the file."""


class NotAFlightError(_PathError):
    """The file can be read, but no flight is in it."""


class MixedFlightsError(FlightFileError):
    """Files were given together that do not belong together."""


class FlightNotWrittenError(_PathError):
    """The operating system does not let us write the file; what was synced before stays."""


class NothingToRecoverError(_PathError):
    """The file began as a flight, but nothing that was recorded is left in it."""


class KeyFileError(_PathError):
    """A key cannot be read from its file, or not be written to it."""
