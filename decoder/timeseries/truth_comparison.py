"""Flight data held against a truth: matched, judged, and put in words, the same for the terminal and for the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from decoder.panel.errors import AccuracyError
from decoder.timeseries.accuracy import Errors, NeedleAccuracy, compare
from decoder.timeseries.clock_offset import ClockOffset, clock_offset
from decoder.timeseries.name_mapping import MappedName, read_mapping
from decoder.timeseries.recorder_limits import Judged, judged, sources_of
from decoder.timeseries.recorder_truth import recorder_truth
from decoder.timeseries.tables import FlightTable, Table, read_table
from decoder.timeseries.thresholds import SPREADS, STEP_S
from decoder.timeseries.truth_request import AUTO, TIME_COLUMN, TruthRequest

HEADER = ["needle", "status", "frames", "mean%", "signed%", "max%", "mean%FS", "max%FS", "mean", "max", "unit", "in95%"]
LIMITS_HEADER = ["needle", "limit", "of", "within", "worst", "unit", "verdict"]
NO_LIMITS = "limits: no needle's name and unit say which recorder parameter it is"


@dataclass(frozen=True, slots=True)
class Truth:
    """A truth, read but not yet held against anything; `mapping` says what it calls the needles."""

    table: Table
    mapping: Mapping[str, MappedName]
    request: TruthRequest


@dataclass(frozen=True, slots=True)
class Compared:
    """What a comparison came to.

    Attributes
    ----------
    truth
        With columns named like the needles, in their units.
    told
        The clocks' offset by the curves, if they tell it.
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
    mapping = {} if request.map_file is None else read_mapping(request.map_file)
    return Truth(read_table(request.file), mapping, request)


def compared(flight: FlightTable, truth: Truth) -> Compared:
    """Flight data against a truth.

    Raises
    ------
    AccuracyError
        If they share no needle or no row, or the curves tell no offset where they were asked to.
    UnitError, TableError
        If the truth's columns are not what the mapping says.
    """
    table, request, told = truth.table, truth.request, None
    if request.has_own_clock:
        table = recorder_truth(flight, table, truth.mapping, request.time_column or TIME_COLUMN)
        told = _told(flight, table, request)
    applied_s = told.offset_s if request.offset == AUTO and told is not None else None
    if isinstance(request.offset, float):
        applied_s = request.offset
    accuracies = compare(flight, table, offset_s=applied_s)
    limits = judged(flight, table, offset_s=applied_s) if request.limits else []
    return Compared(table, accuracies, limits, told, applied_s)


def _told(flight: FlightTable, table: Table, request: TruthRequest) -> ClockOffset | None:
    """Find the offset that the curves tell; without `auto` it is only shown, so it may be unknown."""
    try:
        return clock_offset(flight, table, window_s=request.window_s)
    except AccuracyError:
        if request.offset == AUTO:
            raise
        return None


def offset_text(result: Compared) -> str:
    """Say what was done about the clocks, and what the curves tell."""
    told, applied_s = result.told, result.applied_s
    applied = (
        "nothing was added to the truth's times"
        if applied_s is None
        else f"{applied_s:+.3f} s was added to the truth's times"
    )
    if told is None:
        return f"clock: {applied}; the curves do not tell the offset"
    says = f"{told.offset_s:+.3f} s, sigma {told.sigma_s:.3f} s"
    by = f"correlation {told.correlation:.3f}, {len(told.names)} needles"
    off_s = abs(told.offset_s - (applied_s or 0.0))
    hint = "; to apply it: --offset auto" if off_s > max(SPREADS * told.sigma_s, STEP_S) else ""
    return f"clock: {applied}; the curves tell {says} ({by}){hint}"


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
