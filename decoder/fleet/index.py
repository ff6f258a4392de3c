"""The index over all results in an output: a row for each flight, sorted by name, in `index.csv`.

Rows wait in a temporary file rather than in memory. Rows of earlier runs stay for flights that this run was not about.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from decoder.errors import OutputError
from decoder.fleet.addresses import join
from decoder.fleet.outcome import KINDS, Outcome, as_row, from_row
from decoder.fleet.staging import working_folder
from decoder.fleet.stores import store_of

INDEX = "index.csv"
INDEX_PARQUET = "index.parquet"
ROWS_AT_ONCE = 1000
# A flight that is damaged in many places has many losses in one field.
LONGEST_FIELD = 1 << 30
_NAMING = {"flight", "status"}


class Index:
    """Takes outcomes in any order; use it in a `with` block."""

    def __init__(self) -> None:
        self._places: dict[str, int] = {}
        self._rows = tempfile.TemporaryFile(prefix="fleet-")  # noqa: SIM115 - closed by the `with` block it is made for

    def add(self, outcome: Outcome) -> None:
        """One row; a later one of the same flight takes its place."""
        self._places[outcome.flight] = self._rows.seek(0, io.SEEK_END)
        self._rows.write(json.dumps(as_row(outcome)).encode() + b"\n")

    def add_earlier(self, output: str) -> None:
        """The rows of the index that is there already, but for flights that have one.

        Raises
        ------
        OutputError
            If the file is somebody's own.
        """
        store, address = store_of(output), join(output, INDEX)
        if not store.has(address):
            return
        with working_folder() as folder:
            (path,) = store.fetch([address], folder)
            with path.open(encoding="utf-8", errors="replace", newline="") as stream, _long_fields():
                rows = csv.DictReader(stream)
                if not {*(rows.fieldnames or KINDS)} >= _NAMING:
                    raise OutputError(f"{address}: is no index of flights; move it away or choose another with -o")
                for outcome in filter(None, map(_known, rows)):
                    if outcome.flight not in self._places:
                        self.add(outcome)

    def rows(self) -> Iterator[dict[str, Any]]:
        """By column, sorted by flight."""
        for _, place in sorted(self._places.items()):
            self._rows.seek(place)
            yield json.loads(self._rows.readline())

    def put(self, output: str, *, parquet: bool) -> list[str]:
        """Writes it to an output, whole or not at all; returns the files' addresses.

        A Parquet file of an earlier run is renewed even if this run asks for none.
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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
        return from_row(row)
    except (KeyError, ValueError, TypeError):
        return None  # no row of ours


def _write_csv(rows: Iterator[dict[str, Any]], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, KINDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _write_parquet(rows: Iterator[dict[str, Any]], path: Path) -> None:
    import pyarrow as pa  # noqa: PLC0415 - an extra
    import pyarrow.parquet as pq  # noqa: PLC0415 - an extra

    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([(name, kinds[kind]) for name, kind in KINDS.items()])
    with pq.ParquetWriter(path, schema) as writer:
        while some := list(islice(rows, ROWS_AT_ONCE)):
            writer.write_table(pa.Table.from_pylist(some, schema=schema))


_WRITERS = {INDEX: _write_csv, INDEX_PARQUET: _write_parquet}
