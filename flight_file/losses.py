"""What a reader could not deliver, and where it was."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class LossKind(Enum):
    """What sort of loss it is."""

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
        Bytes of that file which are lost; length 0 where nothing in the file itself is damaged.
    reason
        One sentence without its full stop.
    """

    path: Path
    offset: int
    length: int
    reason: str
    kind: LossKind
