"""Errors of flight files, the losses that a reader reports, and the findings of a verification.

    FlightFileError
    ├── FlightNotReadableError     no such file, a directory, no permission, a read error
    ├── NotAFlightError            not MCAP, empty, or cut before anything was recorded
    ├── MixedFlightsError          the files given are not the segments of one recording
    ├── FlightNotWrittenError      no permission, disk full, or the name is taken
    ├── NothingToRecoverError      a damaged file in which no recorded byte is left
    ├── KeyFileError               a key's file contains no key, or cannot be made
    └── NotYamlError               a text is not YAML, or not accepted

Each message is one sentence that says what to do. Damage *inside* a file is no error: it is a `Loss` that the reader
reports.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
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
    """The file can be read, but contains no flight."""


class MixedFlightsError(FlightFileError):
    """Files were given together that do not belong together."""


class FlightNotWrittenError(_PathError):
    """The operating system does not let us write the file; what was synced before stays."""


class NothingToRecoverError(_PathError):
    """The file began as a flight, but nothing that was recorded is left in it."""


class KeyFileError(_PathError):
    """A key cannot be read from its file, or not be written to it."""


class NotYamlError(FlightFileError):
    """A text is not YAML, or not accepted; the message follows the text's name.

    Attributes
    ----------
    where
        The line, counted from 1; empty if there is none.
    problem
        What is wrong, and what to do.
    """

    def __init__(self, problem: str, *, line: int | None = None) -> None:
        self.where = "" if line is None else f"line {line}"
        self.problem = problem
        super().__init__(f"{self.where} {problem}".lstrip())


class LossKind(Enum):
    """The kind of a loss."""

    DAMAGED = "damaged"
    """Bytes are there but are not what was written."""
    TRUNCATED = "truncated"
    """The file ends early."""
    NO_END = "no end record"
    """The recording was not closed: power cut, kill, or still running."""
    MISSING_SEGMENT = "missing segment"
    """A segment between two given ones was not given."""
    GAP = "gap"
    """Sequence numbers are missing: taken but not stored, or lost with a damaged chunk."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One loss.

    Attributes
    ----------
    path
        The file it was noticed in.
    offset, length
        Lost bytes of that file; length 0 if nothing in the file itself is damaged.
    reason
        One sentence without its full stop.
    """

    path: Path
    offset: int
    length: int
    reason: str
    kind: LossKind

    def __str__(self) -> str:
        """Name the file, and say what is lost."""
        return f"{self.path.name}: {self.reason}"


class FindingKind(Enum):
    """The kind of a finding: first what does not fit, then what is lost, then remarks."""

    CHANGED_PICTURE = "changed picture"
    CHANGED_RECORD = "changed record"
    REMOVED = "removed frame"
    REORDERED = "reordered frame"
    DAMAGED = "damaged"
    CHANGED_SEGMENT = "changed segment"
    OTHER_RECORDING = "segment of another recording"
    WRONG_SIGNATURE = "wrong signature"
    OTHER_KEY = "signed with another key"
    NOT_SIGNED = "not signed"

    MISSING_SEGMENT = "missing segment"
    CUT = "cut off"
    RECOVERED = "recovered with loss"
    UNPROVEN = "not proven"
    NO_CHAIN = "no chain"

    DROPPED = "dropped by the recorder"


LOSSES = frozenset(
    {
        FindingKind.MISSING_SEGMENT,
        FindingKind.CUT,
        FindingKind.RECOVERED,
        FindingKind.UNPROVEN,
        FindingKind.NO_CHAIN,
    }
)


REMARKS = frozenset({FindingKind.DROPPED})


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding.

    Attributes
    ----------
    path
        The file it was found in.
    reason
        One sentence without its full stop.
    sequence, captured_ns
        The frame it is about; None if it is about no frame, or the frame cannot be read any more.
    """

    kind: FindingKind
    path: Path
    reason: str
    sequence: int | None = None
    captured_ns: int | None = None

    @property
    def is_fault(self) -> bool:
        """Whether something does not fit."""
        return self.kind not in LOSSES | REMARKS

    @property
    def is_loss(self) -> bool:
        """Whether something is missing, so that it cannot be checked."""
        return self.kind in LOSSES
