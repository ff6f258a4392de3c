"""`NAME.parquet`: the columns of the CSV, typed, with nulls where there is no value; needs the extra `parquet`.

Each column's unit is in its own metadata; the file's metadata contain the whole description under `flight_data`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from decoder.instruments.reading import Status
from decoder.outputs.json_output import Provenance, as_read_back
from decoder.panel.written import ValueType, Written
from decoder.timeseries.flight_data import CODE, STATUSES, FlightData
from decoder.timeseries.tables import FlightTable

DESCRIPTION_KEY = "flight_data"
UNIT_KEY = "unit"


def write_parquet(data: FlightData, provenance: Provenance, stream: IO[bytes]) -> None:
    """Write flight data as Parquet, identical to what `decode export` makes of their CSV."""
    write_parquet_of_table(as_read_back(data, provenance), stream)


def write_parquet_of_table(flight: FlightTable, stream: IO[bytes]) -> None:
    """Write flight data that were read from a CSV: one row for each frame, `time_utc` in microseconds UTC.

    Raises
    ------
    TableError
        If a time cannot be read.
    """
    table = flight.table
    columns = _leading(
        table.numbers("frame").astype(np.int64),
        flight.time_ns if flight.knows_time_of_day else None,
        table.numbers("time_s"),
    )
    for name in flight.names:
        status = np.array([CODE[Status(text)] for text in table.columns[f"{name}_status"]])
        told = flight.described(name)
        score, sigma = (table.numbers(f"{name}{suffix}") for suffix in ("_score", "_sigma"))
        columns += _needle((name, told.unit), told.written, status, (table.numbers(name, told.written), score, sigma))
    columns += [(name, unit, _numbers(table.numbers(name))) for name, unit in flight.gps_units.items()]
    _write(columns, flight.description, stream)


_MOMENT = pa.timestamp("us", "UTC")
_Column = tuple[str, str, Any]
"""Name, unit, values."""


def _leading(frame: Any, time_ns: Any, time_s: Any) -> list[_Column]:  # noqa: ANN401 - pyarrow has no types
    return [
        ("frame", "", pa.array(frame)),
        ("time_utc", "", pa.array([None] * len(frame) if time_ns is None else time_ns // 1000, _MOMENT)),
        ("time_s", "s", pa.array(time_s)),
    ]


def _needle(
    named: tuple[str, str],
    written: Written | None,
    status: Any,  # noqa: ANN401
    numbers: tuple[Any, ...],
) -> list[_Column]:
    """Make the columns of one needle: value, status, score and sigma."""
    name, unit = named
    value, score, sigma = numbers
    names = pa.array([each.value for each in STATUSES])
    return [
        (name, unit, _values(value, written)),
        (f"{name}_status", "", pa.DictionaryArray.from_arrays(pa.array(status.astype(np.int8)), names)),
        (f"{name}_score", "", _numbers(score)),
        (f"{name}_sigma", unit, _numbers(sigma)),
    ]


def _values(values: Any, written: Written | None) -> Any:  # noqa: ANN401
    """Return numbers, booleans or texts, as they are written."""
    if written is None or written.type is ValueType.NUMBER:
        return _numbers(values)
    if written.type is ValueType.BOOLEAN:
        return pa.array([None if np.isnan(value) else bool(value) for value in values], pa.bool_())
    return pa.array([written.text_of(value) or None for value in values], pa.string())


def _numbers(values: Any) -> Any:  # noqa: ANN401
    return pa.array(values, from_pandas=True)  # NaN becomes null


def _write(columns: Sequence[_Column], description: Mapping[str, Any], stream: IO[bytes]) -> None:
    fields = [
        pa.field(name, values.type, metadata={UNIT_KEY: unit} if unit else None) for name, unit, values in columns
    ]
    metadata = {DESCRIPTION_KEY: json.dumps(description, ensure_ascii=False)}
    schema = pa.schema(fields, metadata=metadata)
    pq.write_table(pa.Table.from_arrays([values for _, _, values in columns], schema=schema), stream)
