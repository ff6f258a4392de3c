"""`NAME.parquet`: the columns of the CSV, typed, with nulls where there is no value; needs the extra `parquet`."""

from __future__ import annotations

from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from decoder.flight_data import STATUSES, FlightData


def write_parquet(data: FlightData, stream: IO[bytes]) -> None:
    """Writes flight data as Parquet: one row for each frame, `time_utc` in microseconds UTC."""
    columns: dict[str, Any] = {
        "frame": pa.array(data.frame),
        "time_utc": pa.array(data.time_ns // 1000, pa.timestamp("us", "UTC")),
        "time_s": pa.array(data.time_s),
    }
    names = pa.array([status.value for status in STATUSES])
    for series in data.series:
        name = series.quantity.name
        columns[name] = _numbers(series.value)
        columns[f"{name}_status"] = pa.DictionaryArray.from_arrays(pa.array(series.status.astype(np.int8)), names)
        columns[f"{name}_score"] = _numbers(series.score)
        columns[f"{name}_sigma"] = _numbers(series.sigma)
    pq.write_table(pa.table(columns), stream)


def _numbers(values: Any) -> Any:  # noqa: ANN401 - pyarrow has no types
    return pa.array(values, from_pandas=True)  # NaN becomes null
