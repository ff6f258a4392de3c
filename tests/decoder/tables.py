"""Flight data and recorders' tables as they are read back from files, made of columns."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from decoder.timeseries.tables import FlightTable, Table, flight_table


def table(columns: Mapping[str, Collection[Any]], path: Path = Path("table.csv")) -> Table:
    """A table of anything."""
    return Table(path, {name: tuple(map(str, values)) for name, values in columns.items()})


def flight_of(
    folder: Path,
    times: Mapping[str, Collection[Any]],
    columns: Mapping[str, Collection[Any]],
    needles: Mapping[str, Mapping[str, object]],
) -> FlightTable:
    """Flight data whose needles are described so; a value None is missing, one in a tuple has a status of its own."""
    whole: dict[str, Collection[Any]] = dict(times)
    for name, values in columns.items():
        pairs = [
            value if isinstance(value, tuple) else (value, "missing" if value is None else "read") for value in values
        ]
        whole[name] = ["" if value is None else value for value, _ in pairs]
        whole[f"{name}_status"] = [status for _, status in pairs]
        whole[f"{name}_sigma"] = [0.1] * len(values)
    described = {name: {"scale_min": 0, "scale_max": 100, **own} for name, own in needles.items()}
    (folder / "flight.json").write_text(json.dumps({"recording": "demo", "needles": described}), encoding="utf-8")
    return flight_table(table(whole, folder / "flight.csv"))
