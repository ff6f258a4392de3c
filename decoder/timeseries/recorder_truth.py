"""The table of a flight data recorder as a truth: its names, units and clock brought to those of the flight data."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from decoder.panel.arrays import Floats
from decoder.panel.errors import AccuracyError, TableError
from decoder.panel.units import converted
from decoder.timeseries.name_mapping import MappedName
from decoder.timeseries.tables import FlightTable, Table, times_ns
from decoder.timeseries.truth_request import TIME_COLUMN

DAY_S = 86400.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)")


def recorder_truth(flight: FlightTable, recorder: Table, mapping: Mapping[str, MappedName], time_column: str) -> Table:
    """Rename and convert a recorder's table: `time_s`, and columns named like the needles, in their units.

    Columns that are named like needles stay as they are, unless `mapping` names another for them. Times may be
    seconds as they are, or times of the day (UTC) or ISO 8601 with a zone, which then count from the flight's first
    frame.

    Raises
    ------
    AccuracyError
        If a needle or a column that the mapping names does not exist.
    UnitError
        If a mapped column's unit is not of the needle's kind.
    TableError
        If a time cannot be read.
    """
    columns = {name: recorder.columns[name] for name in flight.names if name in recorder.columns}
    for needle, mapped in mapping.items():
        if needle not in flight.names:
            raise AccuracyError(f"{flight.table.path}: has no needle {needle}, which the mapping names")
        if mapped.name not in recorder.columns:
            raise AccuracyError(f"{recorder.path}: has no column {mapped.name}, which the mapping names for {needle}")
        columns[needle] = _texts(_in_unit(flight, needle, recorder.numbers(mapped.name), mapped))
    if time_column not in recorder.columns:
        raise AccuracyError(
            f"{recorder.path}: has no column {time_column}; name the one that tells the time with --time"
        )
    return Table(recorder.path, {TIME_COLUMN: _texts(_seconds(flight, recorder, time_column)), **columns})


def _in_unit(flight: FlightTable, needle: str, numbers: Floats, mapped: MappedName) -> Floats:
    scaled = numbers * mapped.factor
    own = flight.described(needle).unit
    return scaled if mapped.unit is None or not own else converted(scaled, mapped.unit, own)


def _seconds(flight: FlightTable, recorder: Table, column: str) -> Floats:
    numbers = recorder.numbers(column)
    if np.isfinite(numbers).any():
        return numbers
    texts = recorder.columns[column]
    clocks = [_CLOCK.fullmatch(text.strip()) for text in texts]
    if any(clocks):
        of_day = [_of_day(clock) for clock in clocks]
        seconds = np.array(of_day)
        known = np.isfinite(seconds)
        seconds[known] = np.unwrap(seconds[known], period=DAY_S)  # past midnight it goes on
        started_s = flight.began_ns / 1e9 % DAY_S
        days = round((float(seconds[known][0]) - started_s) / DAY_S)
        of_flight: Floats = seconds - started_s - days * DAY_S
        return of_flight
    try:
        since: Floats = (times_ns(recorder, column) - flight.began_ns) / 1e9
    except TableError as error:
        raise TableError(f"{error}; give seconds, times such as 12:00:00, or 2018-05-04T12:00:00Z") from error
    return since


def _of_day(clock: re.Match[str] | None) -> float:
    if clock is None:
        return float("nan")
    hours, minutes, seconds = clock.groups()
    return int(hours) * 3600 + int(minutes) * 60 + float(seconds)


def _texts(numbers: Floats) -> tuple[str, ...]:
    return tuple(repr(number) if np.isfinite(number) else "" for number in numbers.tolist())
