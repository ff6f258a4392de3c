"""Tables in CSV files, flight data read back from the files that `decode` wrote, and names in other people's tables.

Name mappings are YAML files that say what our needles are called there, and in which unit:

    airspeed_kt: IAS
    altitude_ft: {name: PALT, unit: m}
    rpm: {name: ENG RPM, unit: rpm, factor: 100}
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from decoder.panel.arrays import Floats, Number
from decoder.panel.description import Strict
from decoder.panel.errors import MappingError, TableError
from decoder.panel.written import ValueType, Written
from flight_file.documents import parse_yaml
from flight_file.errors import NotYamlError
from flight_file.frame import MAX_TIME_NS
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.untrusted import read_regular, read_yaml_file

STATUS_SUFFIX = "_status"


@dataclass(frozen=True, slots=True)
class Table:
    """A CSV file by column, as text."""

    path: Path
    columns: Mapping[str, tuple[str, ...]]

    def numbers(self, column: str, written: Written | None = None) -> Floats:
        """Parse a column as numbers, NaN where the field is empty or no number; states and texts as `Written` says.

        Raises
        ------
        TableError
            If there is no such column.
        """
        if column not in self.columns:
            raise TableError(f"{self.path}: has no column {column}; give the CSV that `decode` wrote")
        parse = _number if written is None else partial(_number_of, written)
        return np.array([parse(field) for field in self.columns[column]])


@dataclass(frozen=True, slots=True)
class Described:
    """A column as the flight data's own description has it; `wraps` is the value of a full turn."""

    unit: str
    full_scale: float | None
    wraps: float | None
    written: Written | None = None


UNDESCRIBED = Described("", None, None)


@dataclass(frozen=True, slots=True)
class FlightTable:
    """Flight data as `decode` wrote them: `NAME.csv`, and the content of `NAME.json` beside it.

    Attributes
    ----------
    names
        The columns with values, in order.
    description
        The content of the JSON; empty if there is none.
    """

    table: Table
    names: tuple[str, ...]
    description: Mapping[str, Any]

    def said_of(self, needle: str) -> Mapping[str, Any]:
        """Look up everything that the description says of a needle; empty if nothing."""
        try:
            said = self.description["needles"][needle]
        except (KeyError, TypeError):
            return {}
        return said if isinstance(said, dict) else {}

    def described(self, needle: str) -> Described:
        """Look up what is known of a needle."""
        try:
            needle_says = self.said_of(needle)
            full_scale = float(needle_says["scale_max"]) - float(needle_says["scale_min"])
            wraps = needle_says.get("wraps")
            numbers = [full_scale] if wraps is None else [full_scale, float(wraps)]
            known = all(math.isfinite(number) and number != 0 for number in numbers)
            said = needle_says.get("type")
            written = None if said is None else Written(ValueType(said), str(needle_says.get("pattern", "")))
            return Described(str(needle_says["unit"]), full_scale, wraps, written) if known else UNDESCRIBED
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError):
            return UNDESCRIBED

    @property
    def gps_units(self) -> Mapping[str, str]:
        """The unit of each of the camera's GPS columns present, by name."""
        gps = self.description.get("gps")
        said = gps.get("columns") if isinstance(gps, dict) else None
        columns = said if isinstance(said, dict) else {}
        units = {name: told.get("unit") for name, told in columns.items() if isinstance(told, dict)}
        return {name: unit for name, unit in units.items() if isinstance(unit, str) and name in self.table.columns}

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """(N,): mid-exposure, realtime; counted from the flight's first frame if the time of day is unknown.

        Raises
        ------
        TableError
            If a time cannot be read.
        """
        if self.knows_time_of_day:
            return times_ns(self.table, "time_utc")
        times: NDArray[np.int64] = np.rint(np.nan_to_num(self.table.numbers("time_s")) * 1e9).astype(np.int64)
        return times

    @property
    def knows_time_of_day(self) -> bool:
        """Whether times are absolute; otherwise they count from the flight's first frame."""
        return any(self.table.columns.get("time_utc", ("",))) or "time_s" not in self.table.columns

    @property
    def began_ns(self) -> int:
        """When `time_s` was 0, at the flight's first frame, which a part of a flight does not contain.

        Raises
        ------
        TableError
            If the first time cannot be read.
        """
        since_s = float(self.table.numbers("time_s")[0]) if "time_s" in self.table.columns else 0.0
        return int(self.time_ns[0]) - round(since_s * 1e9)


def read_table(path: Path, delimiter: str = ",") -> Table:
    """Read a CSV file, or a table with another delimiter.

    Raises
    ------
    TableError
        If it cannot be read or has no rows.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            header, *rows = [row for row in csv.reader(stream, delimiter=delimiter) if row] or [[]]
    except UnicodeDecodeError as error:
        raise TableError(f"{path}: is not text, and so no table; give the CSV of the same name") from error
    except (OSError, csv.Error) as error:
        raise TableError(f"{path}: cannot be read as CSV: {error}") from error
    if not rows:
        raise TableError(f"{path}: has no rows")
    if any(len(row) != len(header) for row in rows):
        raise TableError(f"{path}: its rows are not all as long as its header")
    return Table(path, dict(zip(header, zip(*rows, strict=True), strict=True)))


def flight_table(table: Table) -> FlightTable:
    """Recognize flight data in a table, and read the description beside it.

    Raises
    ------
    TableError
        If the table contains no flight data.
    """
    try:
        description = json.loads(read_regular(table.path.with_suffix(".json"), limit_bytes=MAX_READ_BYTES))
    except (OSError, ValueError, RecursionError):
        description = {}
    return flight_table_of(table, description if isinstance(description, dict) else {})


def flight_table_of(table: Table, description: Mapping[str, Any]) -> FlightTable:
    """Recognize flight data in a table whose description is given.

    Raises
    ------
    TableError
        If the table contains no flight data.
    """
    names = tuple(name for name in table.columns if f"{name}{STATUS_SUFFIX}" in table.columns)
    if not names:
        raise TableError(f"{table.path}: is no flight data; give the CSV that `decode` wrote")
    return FlightTable(table, names, description)


def times_ns(table: Table, column: str) -> NDArray[np.int64]:
    """(N,): a column of ISO 8601 times with `Z` or an offset, as nanoseconds since the Unix epoch.

    Raises
    ------
    TableError
        Naming the first row that has none.
    """
    return np.array([_time_ns(text, table, row) for row, text in enumerate(table.columns[column], start=2)], np.int64)


def _time_ns(text: str, table: Table, row: int) -> int:
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError as error:
        raise TableError(f"{table.path}: row {row}: {text!r} is no time such as 2018-05-04T12:00:00Z") from error
    if moment.tzinfo is None:
        raise TableError(f"{table.path}: row {row}: {text!r} does not say which zone it is in; end it with Z for UTC")
    time_ns = round(moment.timestamp() * 1_000_000) * 1000
    if abs(time_ns) > MAX_TIME_NS:
        raise TableError(f"{table.path}: row {row}: {text!r} is no time that flight data can have")
    return time_ns


def _number(field: str) -> float:
    try:
        return float(field)
    except ValueError:
        return float("nan")


def _number_of(written: Written, field: str) -> float:
    """Return the value of a field written like ours, or as a number."""
    try:
        return written.value_of(field)
    except ValueError:
        return _number(field)


class MappedName(Strict):
    """What a needle is called elsewhere.

    `unit` is the unit there (of an export: the needle's own, where the flight data do not say it), `factor` what
    numbers are multiplied with before anything else.
    """

    name: str
    unit: str | None = None
    factor: Annotated[Number, Field(gt=0)] = 1.0


_MAPPING = TypeAdapter(dict[str, MappedName | str])


def read_mapping(path: Path) -> dict[str, MappedName]:
    """Read a mapping, by needle.

    Raises
    ------
    MappingError
        If it cannot be read or is not a mapping.
    """
    try:
        found = _MAPPING.validate_python(parse_yaml(read_yaml_file(path)))
    except OSError as error:
        raise MappingError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    except NotYamlError as error:
        raise MappingError(error.where, error.problem, source=str(path)) from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"] if part not in ("MappedName", "str"))
        problem = "must be a name, or {name: ..., unit: ..., factor: ...}"
        raise MappingError(where, problem, source=str(path)) from error
    return {needle: MappedName(name=what) if isinstance(what, str) else what for needle, what in found.items()}
