"""What a verification found: which frame does not fit, where, and what that says."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class FindingKind(Enum):
    """What sort of finding it is: in the first group something does not fit, in the second it is lost; then remarks."""

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
    NO_CHAIN = "no chain"

    DROPPED = "dropped by the recorder"


LOSSES = frozenset({FindingKind.MISSING_SEGMENT, FindingKind.CUT, FindingKind.RECOVERED, FindingKind.NO_CHAIN})
REMARKS = frozenset({FindingKind.DROPPED})


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found.

    Attributes
    ----------
    path
        The file it was found in.
    reason
        One sentence without its full stop.
    sequence, captured_ns
        The frame it is about; None where it is about no frame, or where the frame cannot be read any more.
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
        """Whether something is not there, so that nobody can say whether it would fit."""
        return self.kind in LOSSES
