"""The outcome of each flight: a row of the fleet's index, and the marker that says that its results are complete.

Rows wait in a temporary file rather than in memory. Rows of earlier runs are kept for flights not in this run.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, asdict, dataclass, fields
from enum import StrEnum
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec

from decoder.outputs.csv_output import moment_text
from decoder.outputs.outputs import Decoded
from decoder.panel.errors import OutputError
from decoder.parallel.flights import FleetFlight
from decoder.parallel.store import MARKER, Stamp, join, working_folder
from decoder.parallel.stores import store_of
from decoder.timeseries.flight_data import STATUSES, status_counts
from decoder.timeseries.health import health_line
from flight_file.untrusted import from_cell, printable, to_cell

JOINED = " | "  # between several texts in one field

INDEX = "index.csv"
INDEX_PARQUET = "index.parquet"
ROWS_AT_ONCE = 1000
# A flight that is damaged in many places has many losses in one field.
LONGEST_FIELD = 1 << 30
_NAMING = {"flight", "status"}


class State(StrEnum):
    """How a flight got its row in the index."""

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
        The time for checking, fetching, decoding and writing.
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
    """Make the row of a flight that could not be decoded."""
    return Outcome(flight.name, State.FAILED, " ".join(reason.split()), flight_files=JOINED.join(flight.addresses))


def decoded_outcome(flight: FleetFlight, decoded: Decoded, outputs: list[str]) -> Outcome:
    """Make the row of a flight that was decoded, without `size_bytes` and `seconds`."""
    data, provenance = decoded.data, decoded.provenance
    counts = [status_counts(series) for series in data.series]
    totals: dict[str, Any] = {status.value: sum(count[status.value] for count in counts) for status in STATUSES}
    return Outcome(
        flight=flight.name,
        status=State.DECODED,
        recording=provenance.recording,
        frames=len(data.frame),
        start_utc=moment_text(data, int(data.time_ns[0])),
        end_utc=moment_text(data, int(data.time_ns[-1])),
        **totals,
        missing_frames=len(data.missing_frames),
        losses=JOINED.join(provenance.losses),
        warnings=JOINED.join(
            [*data.warnings, *(f"{gauge}: {health_line(found)}" for gauge, found in data.health.items() if found)]
        ),
        outputs=JOINED.join(outputs),
        flight_files=JOINED.join(flight.addresses),
        sha256=JOINED.join(file.sha256 for file in provenance.flight_files),
    )


def from_row(row: Mapping[str, Any]) -> Outcome:
    """Read a row of CSV.

    Raises
    ------
    KeyError, ValueError
        If it is not one.
    """
    known = {name: kind(row[name]) for name, kind in KINDS.items()}
    return Outcome(**{**known, "status": State(known["status"])})


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
        """All names in the results' folder, including the marker's."""
        return [*self.outcome.outputs.split(JOINED), MARKER]

    def still_holds(self, key: dict[str, Any], stamps: Sequence[Stamp]) -> bool:
        """Whether decoding again would certainly give the same."""
        together = len(stamps) == len(self.stamps)
        return self.key == key and together and all(map(Stamp.proves, self.stamps, stamps))

    def may_hold(self, key: dict[str, Any], stamps: Sequence[Stamp]) -> bool:
        """Whether decoding again might give the same, which only the files' digests can decide."""
        return self.key == key and [(each.name, each.size_bytes) for each in self.stamps] == [
            (each.name, each.size_bytes) for each in stamps
        ]


def to_marker(finished: Finished) -> str:
    """Write a marker."""
    return msgspec.json.format(msgspec.json.encode(finished), indent=2).decode() + "\n"


def from_marker(content: bytes | None) -> Finished | None:
    """Read a marker; None if there is none, or it is not one of ours."""
    try:
        return msgspec.json.decode(content or b"", type=Finished)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


class Index:
    """Takes outcomes in any order; to be closed, as by `contextlib.closing`."""

    def __init__(self) -> None:
        self._places: dict[str, int] = {}
        self._rows = tempfile.TemporaryFile(prefix="fleet-")  # noqa: SIM115 - until it is closed

    def add(self, outcome: Outcome) -> None:
        """Add a row; a later one of the same flight replaces it."""
        # A path need not be valid text, but a table can only hold valid text.
        row = {name: printable(value) if isinstance(value, str) else value for name, value in asdict(outcome).items()}
        self._places[row["flight"]] = self._rows.seek(0, io.SEEK_END)
        self._rows.write(json.dumps(row).encode() + b"\n")

    def add_earlier(self, output: str) -> None:
        """Add the rows of an existing index, except for flights that have one already.

        Raises
        ------
        OutputError
            If the file is not an index of ours.
        """
        store, address = store_of(output), join(output, INDEX)
        if not store.has(address):
            return
        with working_folder() as folder:
            (path,) = store.fetch([address], folder)
            with path.open(encoding="utf-8", errors="replace", newline="") as stream, _long_fields():
                rows = csv.DictReader(stream, restval="")
                if not {*(rows.fieldnames or KINDS)} >= _NAMING:
                    raise OutputError(f"{address}: is no index of flights; move it away or choose another with -o")
                for outcome in filter(None, map(_known, rows)):
                    if outcome.flight not in self._places:
                        self.add(outcome)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows by column, sorted by flight."""
        for _, place in sorted(self._places.items()):
            self._rows.seek(place)
            yield json.loads(self._rows.readline())

    def put(self, output: str, *, parquet: bool) -> list[str]:
        """Write it to an output, whole or not at all; return the files' addresses.

        A Parquet file of an earlier run is renewed even if this run does not ask for one.
        """
        written = []
        parquet = parquet or (find_spec("pyarrow") is not None and store_of(output).has(join(output, INDEX_PARQUET)))
        with working_folder() as folder:
            for file in [INDEX, *([INDEX_PARQUET] if parquet else [])]:
                path = folder / file
                _WRITERS[file](self.rows(), path)
                written.append(join(output, file))
                store_of(output).put(path, written[-1])
        return written

    def close(self) -> None:
        """Remove the temporary file."""
        self._rows.close()


@contextmanager
def _long_fields() -> Iterator[None]:
    before = csv.field_size_limit(LONGEST_FIELD)
    try:
        yield
    finally:
        csv.field_size_limit(before)


def _known(row: dict[str, str]) -> Outcome | None:
    try:
        return from_row({name: from_cell(cell) for name, cell in row.items()})
    except (KeyError, ValueError, TypeError):
        return None  # not one of our rows


def _write_csv(rows: Iterator[dict[str, Any]], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, KINDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: to_cell(str(value)) for name, value in row.items()} for row in rows)


def _write_parquet(rows: Iterator[dict[str, Any]], path: Path) -> None:
    import pyarrow as pa  # noqa: PLC0415 - an extra
    import pyarrow.parquet as pq  # noqa: PLC0415 - an extra

    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, kinds[kind]) for name, kind in KINDS.items()])
    with pq.ParquetWriter(path, schema) as writer:
        while some := list(islice(rows, ROWS_AT_ONCE)):
            writer.write_table(pa.Table.from_pylist(some, schema=schema))


_WRITERS = {INDEX: _write_csv, INDEX_PARQUET: _write_parquet}
