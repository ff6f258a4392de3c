"""Flight data compared with a truth: matched, judged, and put in words, the same for the terminal and for the report.

A truth may be a flight data recorder's, whose names, units and clock are first brought to those of the flight data. Or
it may be the flight data's own columns from the camera's GPS.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.errors import AccuracyError, TableError
from decoder.panel.units import converted
from decoder.panel.vocabulary import AUTO, TIME_COLUMN, Names, TruthRequest
from decoder.timeseries.accuracy import Errors, Judged, NeedleAccuracy, compare, judged, sources_of
from decoder.timeseries.clock_offset import ClockOffset, clock_offset
from decoder.timeseries.engine_sound import EngineSpeed
from decoder.timeseries.tables import FlightTable, MappedName, Table, read_mapping, read_table, times_ns
from decoder.timeseries.thresholds import STEP_S
from flight_file.frame import NS_PER_S

RPM = "rpm"
HEADER = ["needle", "status", "frames", "mean%", "signed%", "max%", "mean%FS", "max%FS", "mean", "max", "unit", "in95%"]
LIMITS_HEADER = ["needle", "limit", "of", "within", "worst", "unit", "verdict"]
NO_LIMITS = "limits: no needle's name and unit say which recorder parameter it is"
DAY_S = 86400.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)")


@dataclass(frozen=True, slots=True)
class Truth:
    """A truth, read but not yet compared with anything; `mapping` says what it calls the needles."""

    table: Table
    mapping: Mapping[str, MappedName]
    request: TruthRequest


@dataclass(frozen=True, slots=True)
class Compared:
    """The result of a comparison.

    Attributes
    ----------
    truth
        With columns named like the needles, in their units.
    told
        The clocks' offset according to the curves, if they determine it.
    applied_s
        What was added to the truth's times; None for nothing.
    """

    truth: Table
    accuracies: Sequence[NeedleAccuracy]
    limits: Sequence[Judged]
    told: ClockOffset | None
    applied_s: float | None


def read_truth(request: TruthRequest) -> Truth:
    """Read a truth.

    Raises
    ------
    TableError, MappingError
        If it or its mapping cannot be read.
    """
    return Truth(read_table(request.file), _mapping(request.names), request)


def _mapping(names: Names | None) -> dict[str, MappedName]:
    if names is None:
        return {}
    if isinstance(names, Path):
        return read_mapping(names)
    return {needle: MappedName(name=column) for needle, column in names}


def compared(flight: FlightTable, truth: Truth) -> Compared:
    """Compare flight data with a truth.

    Raises
    ------
    AccuracyError
        If they share no needle or no row, or the curves determine no offset although asked to.
    UnitError, TableError
        If the truth's columns are not what the mapping says.
    """
    table, request, told = truth.table, truth.request, None
    if truth.mapping and table.path == flight.table.path:
        table = gps_truth(flight, truth.mapping)
    elif request.has_own_clock:
        table = recorder_truth(flight, table, truth.mapping, request.time_column or TIME_COLUMN)
    if request.has_own_clock:
        told = _told(flight, table, request)
    applied_s = told.offset_s if request.offset == AUTO and told is not None else None
    if isinstance(request.offset, float):
        applied_s = request.offset
    accuracies = compare(flight, table, offset_s=applied_s)
    limits = judged(flight, table, offset_s=applied_s) if request.limits else []
    return Compared(table, accuracies, limits, told, applied_s)


def left_out(flight: FlightTable, result: Compared) -> dict[str, str]:
    """Return why needles were not compared, by needle."""
    held = {each.needle: each for each in result.accuracies}
    reasons = {}
    for name in flight.names:
        if name not in held:
            reasons[name] = "the truth has no such column"
        elif not held[name].frames_compared:
            reasons[name] = "the truth has no value at any of its frames"
        elif not held[name].by_status:
            reasons[name] = "it has no value where the truth has one"
    return reasons


def _told(flight: FlightTable, table: Table, request: TruthRequest) -> ClockOffset | None:
    """Find the offset according to the curves; without `auto` it is only shown, so it may be unknown."""
    try:
        return clock_offset(flight, table, window_s=request.window_s)
    except AccuracyError:
        if request.offset == AUTO:
            raise
        return None


def gps_truth(flight: FlightTable, mapping: Mapping[str, MappedName]) -> Table:
    """Make a truth from the flight data's own columns of the camera's GPS, named like the needles, in their units.

    Raises
    ------
    AccuracyError
        If a needle or a column that the mapping names does not exist.
    UnitError
        If a column's unit is not of the needle's kind.
    """
    own = flight.table
    columns = {name: own.columns[name] for name in ("frame", TIME_COLUMN) if name in own.columns}
    for needle, mapped in mapping.items():
        if needle not in flight.names:
            raise AccuracyError(f"{own.path}: has no needle {needle}, which the mapping names")
        unit = flight.gps_units.get(mapped.name)
        if unit is None:
            known = ", ".join(flight.gps_units) or "none, since its flight file holds no position"
            raise AccuracyError(f"{own.path}: has no column {mapped.name} of the camera's GPS; it has {known}")
        said = mapped.model_copy(update={"unit": mapped.unit or unit})
        columns[needle] = _texts(_in_unit(flight, needle, own.numbers(mapped.name), said))
    return Table(own.path, columns)


def recorder_truth(flight: FlightTable, recorder: Table, mapping: Mapping[str, MappedName], time_column: str) -> Table:
    """Rename and convert a recorder's table: `time_s`, and columns named like the needles, in their units.

    Columns that are already named like needles stay as they are, unless `mapping` names others for them. Times may be
    plain seconds, or times of day (UTC) or ISO 8601 with a zone, which are then counted from the flight's first frame.

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
        raise AccuracyError(f"{recorder.path}: has no column {time_column}; name its time column with --time")
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
        seconds[known] = np.unwrap(seconds[known], period=DAY_S)  # continue past midnight
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


def offset_text(result: Compared) -> str:
    """Say what was done about the clocks, and what the curves suggest."""
    told, applied_s = result.told, result.applied_s
    applied = (
        "nothing was added to the truth's times"
        if applied_s is None
        else f"{applied_s:+.3f} s was added to the truth's times"
    )
    if told is None:
        return f"clock: {applied}; the curves do not show the offset"
    says = f"{told.offset_s:+.3f} s, sigma {told.sigma_s:.3f} s"
    by = f"correlation {told.correlation:.3f}, {len(told.names)} needles"
    off_s = abs(told.offset_s - (applied_s or 0.0))
    hint = "; to apply it: --offset auto" if off_s > max(BEYOND_CHANCE_SPREADS * told.sigma_s, STEP_S) else ""
    return f"clock: {applied}; the curves suggest {says} ({by}){hint}"


def accuracy_rows(results: Sequence[NeedleAccuracy]) -> list[list[str]]:
    """Fill the table under `HEADER`: a row for each needle and status."""
    return [_row(result, status) for result in results for status in result.by_status]


def limit_rows(verdicts: Sequence[Judged]) -> list[list[str]]:
    """Fill the table under `LIMITS_HEADER`."""
    return [
        [one.needle, one.limit, one.source, f"{one.within:.1%}", f"{one.worst:.4g}", one.unit, one.verdict.value]
        for one in verdicts
    ]


def source_lines(verdicts: Sequence[Judged]) -> list[str]:
    """List the full names of the limits' sources."""
    return [f"{short}: {full}" for short, full in sources_of(verdicts).items()]


def _row(result: NeedleAccuracy, status: str) -> list[str]:
    errors: Errors = result.by_status[status]
    return [
        result.needle,
        status,
        str(errors.frames),
        _text(errors.mean_abs_pct),
        _text(errors.mean_signed_pct, sign="+"),
        _text(errors.max_abs_pct),
        _text(errors.mean_abs_pct_fs),
        _text(errors.max_abs_pct_fs),
        f"{errors.mean_abs:.4g}",
        f"{errors.max_abs:.4g}",
        result.unit,
        f"{errors.within_95:.0%}",
    ]


def _text(value: float | None, sign: str = "") -> str:
    return "-" if value is None else f"{value:{sign}.4f}"


@dataclass(frozen=True, slots=True)
class HeldAgainstSound:
    """A tachometer compared with the engine's speed from sound; the two are never averaged.

    Attributes
    ----------
    windows
        In which both have a value.
    apart_rpm
        The median of sound minus tachometer.
    beyond
        The number of windows in which they differ by more than both can be off.
    """

    name: str
    windows: int
    apart_rpm: float
    mean_rpm: float
    beyond: int

    @property
    def words(self) -> str:
        """The result as a sentence."""
        way = "above" if self.apart_rpm > 0 else "below"
        part = abs(self.apart_rpm) / self.mean_rpm
        return (
            f"{self.name}: the sound is {abs(self.apart_rpm):.0f} rpm ({part:.1%}) {way} it, median of"
            f" {self.windows} windows; in {self.beyond} of them by more than both can be off"
        )


def held_against_sound(flight: FlightTable, speed: EngineSpeed, began_ns: int) -> list[HeldAgainstSound]:
    """Compare each tachometer in flight data with the engine's speed from sound.

    Parameters
    ----------
    began_ns
        When the flight's `time_s` is 0, by the clock of `speed`.

    Raises
    ------
    TableError
        If the flight data have no times.
    """
    heard_s = (speed.time_ns - began_ns) / NS_PER_S
    names = [name for name in flight.names if flight.described(name).unit == RPM or name.endswith(RPM)]
    found = [_held_against_sound(flight.table, name, speed, heard_s) for name in names]
    return [held for held in found if held is not None]


def _held_against_sound(table: Table, name: str, speed: EngineSpeed, heard_s: Floats) -> HeldAgainstSound | None:
    """Compare them where both have a value within a second of each other; None if there is no such place."""
    time_s, value, sigma = (table.numbers(column) for column in ("time_s", name, f"{name}_sigma"))
    seen = np.flatnonzero(np.isfinite(value) & np.isfinite(time_s))
    seen = seen[np.argsort(time_s[seen], kind="stable")]
    heard = np.isfinite(speed.rpm)
    if not seen.size or not heard.any():
        return None
    known_s = time_s[seen]
    behind = np.clip(np.searchsorted(known_s, heard_s), 1, max(len(known_s) - 1, 1)) % len(known_s)
    nearest = np.where(np.abs(known_s[behind] - heard_s) < np.abs(known_s[behind - 1] - heard_s), behind, behind - 1)
    both = heard & (np.abs(heard_s - known_s[nearest]) * NS_PER_S <= NS_PER_S)
    if not both.any():
        return None
    shown = np.interp(heard_s, known_s, value[seen])[both]
    apart = speed.rpm[both] - shown
    off = np.hypot(speed.sigma, np.nan_to_num(sigma[seen])[nearest])[both]
    beyond = int((np.abs(apart) > BEYOND_CHANCE_SPREADS * off).sum())
    return HeldAgainstSound(name, len(apart), float(np.median(apart)), float(np.mean(shown)), beyond)
