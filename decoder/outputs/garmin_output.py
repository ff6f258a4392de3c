"""The log of a Garmin G1000, as flight-analysis sites read it: three header lines, then one row per second, UTC.

Names are recognised only for quantities that a G1000 has a column for; anything else needs a name mapping.

The format has no place for a status or an uncertainty, so only values that were seen are written: for each whole second
that of the nearest frame within half a second, and nothing if it is interpolated or missing. The position stays empty.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import IO

import numpy as np
from numpy.typing import NDArray

from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.errors import OutputError, UnitError
from decoder.panel.parameters import WORDS, parameter_of
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.panel.units import converted, engine_stem_of, stem_of
from decoder.timeseries.tables import FlightTable, MappedName
from flight_file.frame import NS_PER_S
from flight_file.untrusted import printable

ENGINES = 2

SEEN = (Status.READ.value, Status.EDGE.value, Status.HIDDEN.value)
TIME_COLUMNS = (("  Lcl Date", "#yyy-mm-dd"), ("Lcl Time", "hh:mm:ss"), ("UTCOfst", "  hh:mm"))
WIDTH = 8


@dataclass(frozen=True, slots=True)
class GarminColumn:
    """One column: its name in the log, its unit as the log and as `units` write it, and its decimals."""

    name: str
    unit_text: str
    unit: str
    decimals: int = 1


_AIRCRAFT: dict[tuple[str, ...], GarminColumn] = {
    WORDS["altitude"]: GarminColumn("AltB", "ft Baro", "ft"),
    WORDS["altimeter setting"]: GarminColumn("BaroA", "inch", "inHg", 2),
    ("oat", "outside_air_temp"): GarminColumn("OAT", "deg C", "deg C"),
    WORDS["airspeed"]: GarminColumn("IAS", "kt", "kt"),
    ("ground_speed",): GarminColumn("GndSpd", "kt", "kt"),
    WORDS["vertical speed"]: GarminColumn("VSpd", "fpm", "fpm"),
    WORDS["pitch"]: GarminColumn("Pitch", "deg", "deg"),
    WORDS["roll"]: GarminColumn("Roll", "deg", "deg"),
    WORDS["heading"]: GarminColumn("HDG", "deg", "deg"),
    ("volts", "bus_volts"): GarminColumn("volt1", "volts", "V"),
    ("amps", "bus_amps"): GarminColumn("amp1", "amps", "A"),
    ("fuel_left", "fuel_quantity_left"): GarminColumn("FQtyL", "gals", "gal", 2),
    ("fuel_right", "fuel_quantity_right"): GarminColumn("FQtyR", "gals", "gal", 2),
    WORDS["true airspeed"]: GarminColumn("TAS", "kt", "kt"),
}
_ENGINE: dict[tuple[str, ...], GarminColumn] = {
    ("fuel_flow",): GarminColumn("FFlow", "gph", "gph", 2),
    ("oil_temp", "oil_temperature"): GarminColumn("OilT", "deg F", "deg F"),
    ("oil_press", "oil_pressure"): GarminColumn("OilP", "psi", "psi"),
    ("map", "manifold_pressure"): GarminColumn("MAP", "Hg", "inHg", 2),
    ("rpm", "engine_rpm"): GarminColumn("RPM", "rpm", "rpm"),
    ("torque", "trq"): GarminColumn("Torq", "%", "%"),
    ("ng",): GarminColumn("NG", "%", "%"),
    ("itt",): GarminColumn("ITT", "deg C", "deg C"),
    ("cht",): GarminColumn("CHT1", "deg F", "deg F"),
    ("egt",): GarminColumn("EGT1", "deg F", "deg F"),
    ("tit",): GarminColumn("TIT1", "deg F", "deg F"),
}

BLANK = (
    GarminColumn("AtvWpt", "ident", ""),
    GarminColumn("Latitude", "degrees", ""),
    GarminColumn("Longitude", "degrees", ""),
)
"""Columns that every log has and that no gauge shows; they stay empty."""


def _of_engine(column: GarminColumn, engine: int) -> GarminColumn:
    return GarminColumn(f"E{engine} {column.name}", column.unit_text, column.unit, column.decimals)


COLUMNS: tuple[GarminColumn, ...] = (
    *BLANK,
    *_AIRCRAFT.values(),
    *(_of_engine(column, engine) for engine in range(1, ENGINES + 1) for column in _ENGINE.values()),
)
"""All columns in their order in the log."""

SIGNED = (_AIRCRAFT[WORDS["pitch"]], _AIRCRAFT[WORDS["roll"]])
"""Angles to both sides of 0, also where a bank ring counts from 0 to 360."""

BY_NAME = {column.name: column for column in COLUMNS}
_BY_STEM = {stem: column for stems, column in _AIRCRAFT.items() for stem in stems}
_OF_PARAMETERS = {parameter for parameter, words in WORDS.items() if words in _AIRCRAFT}
_BY_ENGINE_STEM = {stem: column for stems, column in _ENGINE.items() for stem in stems}


def column_of(name: str) -> GarminColumn | None:
    """Find the column for a needle by its name; None if the name does not identify it."""
    stem = stem_of(name)
    if stem in _BY_STEM:
        return _BY_STEM[stem]
    stem, engine = engine_stem_of(name)
    column = _BY_ENGINE_STEM.get(stem)
    return None if column is None else BY_NAME.get(_of_engine(column, engine).name)


def _by_last_words(names: Sequence[str], taken: Collection[GarminColumn]) -> dict[str, GarminColumn]:
    """Find columns for names such as `hi_heading_deg` by their last word, if nothing else has that column."""
    columns = {name: _BY_STEM[WORDS[found][0]] for name in names if (found := parameter_of(name)) in _OF_PARAMETERS}
    counted = Counter(columns.values())
    return {name: column for name, column in columns.items() if counted[column] == 1 and column not in taken}


@dataclass(frozen=True, slots=True)
class Chosen:
    """A needle and its column; (N,) values in the column's unit."""

    needle: str
    column: GarminColumn
    values: Floats


@dataclass(frozen=True, slots=True)
class GarminPlan:
    """What goes into a log, and why the other needles do not."""

    chosen: tuple[Chosen, ...]
    left_out: Mapping[str, str]


def plan(flight: FlightTable, mapping: Mapping[str, MappedName]) -> GarminPlan:
    """Assign needles to columns.

    `mapping` names columns for needles, and takes precedence over their names.

    Raises
    ------
    OutputError
        If a mapped needle or column does not exist, two needles would go into one column, or nothing can be written.
    UnitError
        If a mapped needle's unit is not of its column's kind.
    """
    chosen: list[Chosen] = []
    left_out: dict[str, str] = {}
    for name in mapping:
        if name not in flight.names:
            raise OutputError(f"{flight.table.path}: has no needle {name}, which the mapping names")
    columns = {name: _mapped_column(mapping[name]) if name in mapping else column_of(name) for name in flight.names}
    known = {column for column in columns.values() if column is not None}
    columns |= _by_last_words([name for name, column in columns.items() if column is None], known)
    for name, column in columns.items():
        if column is None:
            left_out[name] = "no column of a G1000 log goes by its name"
            continue
        try:
            chosen.append(Chosen(name, column, _values(flight, name, column, mapping.get(name))))
        except UnitError as error:
            if name in mapping:
                raise
            left_out[name] = str(error)
    if not flight.knows_time_of_day:
        raise OutputError(
            f"{flight.table.path}: a G1000 log needs the time of day, which is unknown for this flight; make its flight"
            " file again with --start or --clock"
        )
    _check(flight, chosen)
    return GarminPlan(tuple(chosen), left_out)


def _mapped_column(mapped: MappedName) -> GarminColumn:
    if mapped.name not in BY_NAME or BY_NAME[mapped.name] in BLANK:
        known = ", ".join(column.name for column in COLUMNS if column not in BLANK)
        raise OutputError(f"a G1000 log has no column {mapped.name!r} that a gauge shows; it has {known}")
    return BY_NAME[mapped.name]


def _values(flight: FlightTable, name: str, column: GarminColumn, mapped: MappedName | None) -> Floats:
    """Convert what was seen of a needle to a column's unit, NaN elsewhere."""
    own = mapped or MappedName(name=column.name)
    unit = own.unit or flight.described(name).unit
    values = converted(flight.table.numbers(name) * own.factor, unit, column.unit)
    if column in SIGNED:
        values = shortest(values, FULL_CIRCLE_DEG)
    return np.where(np.isin(flight.table.columns[f"{name}_status"], SEEN), values, np.nan)


def _check(flight: FlightTable, chosen: Sequence[Chosen]) -> None:
    by_column: dict[str, str] = {}
    for one in chosen:
        if one.column.name in by_column:
            other = by_column[one.column.name]
            raise OutputError(f"{other} and {one.needle} would both be {one.column.name}; say with --map which it is")
        by_column[one.column.name] = one.needle
    if not chosen:
        raise OutputError(
            f"{flight.table.path}: no needle's name says which column of a G1000 log it is; name them with --map"
        )


def write_garmin(flight: FlightTable, chosen: Sequence[Chosen], stream: IO[str]) -> None:
    """Write flight data as a G1000 log.

    Raises
    ------
    TableError
        If a time cannot be read.
    """
    time_ns = flight.time_ns
    seconds = np.arange(_rounded(time_ns.min()), _rounded(time_ns.max()) + 1)
    values = {one.column.name: _nearest(time_ns, one.values, seconds) for one in chosen}
    columns = [column for column in COLUMNS if column in BLANK or column.name in values]
    airframe = printable(str(flight.description.get("recording", flight.table.path.stem))).replace('"', "'")
    stream.write(f'#airframe_info, log_version="1.00", airframe_name="{airframe}", mode=NORMAL,\n')
    stream.write(_line([text for _, text in TIME_COLUMNS], [column.unit_text for column in columns]))
    stream.write(_line([text for text, _ in TIME_COLUMNS], [column.name for column in columns]))
    for row, second in enumerate(seconds.tolist()):
        moment = datetime.fromtimestamp(second, UTC)
        cells = [_cell(values[column.name][row], column) if column.name in values else "" for column in columns]
        stream.write(_line([f"{moment:%Y-%m-%d}", f"{moment:%H:%M:%S}", " +00:00"], cells))


def _cell(value: float, column: GarminColumn) -> str:
    return f"{value:.{column.decimals}f}" if np.isfinite(value) else ""


def _nearest(time_ns: NDArray[np.int64], values: Floats, seconds: NDArray[np.int64]) -> Floats:
    """Pick the value nearest to each whole second, NaN where none is within half a second."""
    time_ns, values = time_ns[np.isfinite(values)], values[np.isfinite(values)]
    if not time_ns.size:
        return np.full(len(seconds), np.nan)
    order = np.argsort(time_ns, kind="stable")
    times, wanted = time_ns[order], seconds * NS_PER_S
    after = np.clip(np.searchsorted(times, wanted), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    chosen = np.where(np.abs(times[before] - wanted) <= np.abs(times[after] - wanted), before, after)
    near = np.abs(times[chosen] - wanted) <= NS_PER_S // 2
    return np.where(near, values[order][chosen], np.nan)


def _rounded(time_ns: int) -> int:
    return int((time_ns + NS_PER_S // 2) // NS_PER_S)


def _line(leading: Sequence[str], cells: Sequence[str]) -> str:
    return ", ".join([*leading, *(cell.rjust(WIDTH) for cell in cells)]) + "\n"
