"""What became of one flight: a row of the fleet's index."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from decoder.csv_output import utc_text
from decoder.fleet.flights import FleetFlight
from decoder.flight_data import STATUSES, status_counts
from decoder.formats import Decoded

JOINED = " | "  # between several texts in one field


class State(StrEnum):
    """How a flight came to its row."""

    DECODED = "decoded"
    KEPT = "kept"  # finished by an earlier run
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Outcome:
    """One flight's row.

    Attributes
    ----------
    reason
        Why it failed; empty otherwise.
    read, edge, hidden, interpolated, missing
        Readings with that status, all needles together.
    missing_frames
        Frames that could not be read at all.
    losses, warnings, outputs, flight_files, sha256
        Several are joined by ` | `; outputs are names in the flight's folder, `sha256` is of each flight file in order.
    seconds
        What checking, fetching, decoding and writing took.
    """

    flight: str
    status: State
    reason: str = ""
    recording: str = ""
    frames: int = 0
    start_utc: str = ""
    end_utc: str = ""
    read: int = 0
    edge: int = 0
    hidden: int = 0
    interpolated: int = 0
    missing: int = 0
    missing_frames: int = 0
    losses: str = ""
    warnings: str = ""
    outputs: str = ""
    flight_files: str = ""
    size_bytes: int = 0
    sha256: str = ""
    seconds: float = 0.0


KINDS: dict[str, type] = {
    field.name: str if field.default is MISSING else type(field.default) for field in fields(Outcome)
}
"""The index's columns, and of which kind each is: text, whole numbers or numbers."""


def failed(flight: FleetFlight, reason: str) -> Outcome:
    """The row of a flight that could not be decoded."""
    return Outcome(flight.name, State.FAILED, " ".join(reason.split()), flight_files=JOINED.join(flight.addresses))


def decoded_outcome(flight: FleetFlight, decoded: Decoded, outputs: list[str]) -> Outcome:
    """The row of a flight that was decoded; `size_bytes` and `seconds` are not in it yet."""
    data, provenance = decoded.data, decoded.provenance
    counts = [status_counts(series) for series in data.series]
    totals: dict[str, Any] = {status.value: sum(count[status.value] for count in counts) for status in STATUSES}
    return Outcome(
        flight=flight.name,
        status=State.DECODED,
        recording=provenance.recording,
        frames=len(data.frame),
        start_utc=utc_text(int(data.time_ns[0])),
        end_utc=utc_text(int(data.time_ns[-1])),
        **totals,
        missing_frames=len(data.missing_frames),
        losses=JOINED.join(provenance.losses),
        warnings=JOINED.join(data.warnings),
        outputs=JOINED.join(outputs),
        flight_files=JOINED.join(flight.addresses),
        sha256=JOINED.join(file.sha256 for file in provenance.flight_files),
    )


def as_row(outcome: Outcome) -> dict[str, Any]:
    """By column, as JSON can hold it."""
    return asdict(outcome)


def from_row(row: Mapping[str, Any]) -> Outcome:
    """The outcome of a row, of JSON or of a CSV.

    Raises
    ------
    KeyError, ValueError
        If it is none.
    """
    known = {name: kind(row[name]) for name, kind in KINDS.items()}
    return Outcome(**{**known, "status": State(known["status"])})
