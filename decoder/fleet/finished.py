"""The marker that says a flight's results are all there, and of what they were made."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from decoder.fleet.outcome import JOINED, Outcome, as_row, from_row
from decoder.fleet.store import MARKER, Stamp


@dataclass(frozen=True, slots=True)
class Finished:
    """A flight's results as their marker describes them.

    Attributes
    ----------
    key
        Of the order they were made for.
    stamps
        Of the flight's files as they were then.
    """

    key: dict[str, Any]
    stamps: tuple[Stamp, ...]
    outcome: Outcome

    @property
    def files(self) -> list[str]:
        """All names in the results' folder, the marker's too."""
        return [*self.outcome.outputs.split(JOINED), MARKER]

    def still_holds(self, key: dict[str, Any], stamps: Sequence[Stamp]) -> bool:
        """Whether decoding again would certainly give the same."""
        together = len(stamps) == len(self.stamps)
        return self.key == key and together and all(map(Stamp.proves, self.stamps, stamps))

    def may_hold(self, key: dict[str, Any], stamps: Sequence[Stamp]) -> bool:
        """Whether only the files' digests can tell."""
        return self.key == key and [(each.name, each.size_bytes) for each in self.stamps] == [
            (each.name, each.size_bytes) for each in stamps
        ]


def to_marker(finished: Finished) -> str:
    """The marker's text."""
    content = {
        "key": finished.key,
        "stamps": [asdict(stamp) for stamp in finished.stamps],
        "outcome": as_row(finished.outcome),
    }
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def from_marker(content: bytes | None) -> Finished | None:
    """What a marker says; None if there is none, or it is not one of ours."""
    try:
        found = json.loads(content or b"null")
        stamps = tuple(Stamp(**stamp) for stamp in found["stamps"])
        return Finished(found["key"], stamps, from_row(found["outcome"]))
    except (ValueError, KeyError, TypeError):
        return None
