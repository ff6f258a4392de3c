"""`decode accuracy FLIGHT_DATA TRUTH.csv`: the thesis's accuracy table for any needle, also against a recorder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from decoder.accuracy import Errors, NeedleAccuracy, compare
from decoder.clock_offset import WINDOW_S, ClockOffset, clock_offset
from decoder.errors import AccuracyError
from decoder.name_mapping import read_mapping
from decoder.recorder_limits import Judged, judged, sources_of
from decoder.recorder_truth import TIME_COLUMN, recorder_truth
from decoder.tables import FlightTable, Table, flight_table, read_table
from decoder.text_table import text_table

HEADER = ["needle", "status", "frames", "mean%", "signed%", "max%", "mean%FS", "max%FS", "mean", "max", "unit", "in95%"]
LIMITS_HEADER = ["needle", "limit", "of", "within", "worst", "unit", "verdict"]
NOTICED_SIGMAS, NOTICED_S = 3.0, 0.1
EPILOG = """\b
Percent columns: % of the true value (the thesis's measure; `mean` and `max` of the absolute error, `signed` of the
signed one), %FS of full scale, then in the gauge's own unit. `in95%`: frames whose error is within 1.96 sigma.

\b
A flight data recorder has its own names, units and clock:
--map      a YAML file: NEEDLE: COLUMN, or NEEDLE: {name: COLUMN, unit: UNIT, factor: NUMBER}
--time     its column of times: seconds, times of the day, or ISO 8601 with a zone
--offset   what to add to its times: SECONDS, or auto to let the curves tell; without it nothing is added
--limits   judge each parameter by what regulators ask of recorders: pass if 95 % of its values are within the limit

\b
Examples:
  decode accuracy flight.csv truth.csv
  decode accuracy flight.csv truth.csv --json
  decode accuracy flight.csv fdr.csv --map names.yaml --time TIME --offset auto --limits
"""


def _offset(_context: click.Context, _option: click.Parameter, value: str | None) -> str | float | None:
    if value is None or value == "auto":
        return value
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is neither auto nor a number of seconds") from error


@click.command("accuracy", epilog=EPILOG)
@click.argument("flight_data", type=click.Path(path_type=Path))
@click.argument("truth", type=click.Path(path_type=Path))
@click.option("--map", "map_file", type=click.Path(path_type=Path), metavar="YAML", help="What the truth calls them.")
@click.option("--time", "time_column", metavar="COLUMN", help=f"The truth's column of times.  [default: {TIME_COLUMN}]")
@click.option("--offset", callback=_offset, metavar="auto|SECONDS", help="What to add to the truth's times.")
@click.option("--window", "window_s", type=click.FloatRange(min=1), default=WINDOW_S, show_default=True, metavar="S",
              help="How far `--offset auto` looks, seconds to either side.")  # fmt: skip
@click.option("--limits", "wants_limits", is_flag=True, help="Judge parameters by published recorder accuracies.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(
    flight_data: Path,
    truth: Path,
    *,
    map_file: Path | None,
    time_column: str | None,
    offset: str | float | None,
    window_s: float,
    wants_limits: bool,
    as_json: bool,
) -> None:
    """Hold FLIGHT_DATA (the CSV that `decode` wrote) against TRUTH, a CSV whose columns are named like the needles.

    Rows are matched by `frame` where both have that column, otherwise by `time_s`, the truth interpolated between its
    rows. The truth may also be a flight data recorder's, with names, units and a clock of its own.
    """
    flight, true = flight_table(read_table(flight_data)), read_table(truth)
    own_clock = any(option is not None for option in (map_file, time_column, offset))
    if own_clock:
        mapping = {} if map_file is None else read_mapping(map_file)
        true = recorder_truth(flight, true, mapping, time_column or TIME_COLUMN)
    found = _found(flight, true, offset, window_s) if own_clock else None
    applied_s = found.offset_s if offset == "auto" and found is not None else _number(offset)
    results = compare(flight.table, true, offset_s=applied_s)
    verdicts = judged(flight, true, offset_s=applied_s) if wants_limits else []
    if as_json:
        click.echo(
            json.dumps(_document(results, verdicts, found, applied_s, plain=not (own_clock or wants_limits)), indent=2)
        )
        return
    if own_clock:
        click.echo(_offset_text(found, applied_s) + "\n")
    click.echo(text_table(HEADER, [_row(result, status) for result in results for status in result.by_status]))
    if wants_limits:
        click.echo("\n" + _limits_text(verdicts))


def _number(offset: str | float | None) -> float | None:
    return offset if isinstance(offset, float) else None


def _found(flight: FlightTable, true: Table, offset: str | float | None, window_s: float) -> ClockOffset | None:
    """The offset that the curves tell; without `auto` it is only shown, so that it may as well be unknown."""
    try:
        return clock_offset(flight, true, window_s=window_s)
    except AccuracyError:
        if offset == "auto":
            raise
        return None


def _offset_text(found: ClockOffset | None, applied_s: float | None) -> str:
    applied = (
        "nothing was added to the truth's times"
        if applied_s is None
        else f"{applied_s:+.3f} s was added to the truth's times"
    )
    if found is None:
        return f"clock: {applied}; the curves do not tell the offset"
    told = f"{found.offset_s:+.3f} s, sigma {found.sigma_s:.3f} s"
    by = f"correlation {found.correlation:.3f}, {len(found.needles)} needles"
    off_s = abs(found.offset_s - (applied_s or 0.0))
    hint = "; to apply it: --offset auto" if off_s > max(NOTICED_SIGMAS * found.sigma_s, NOTICED_S) else ""
    return f"clock: {applied}; the curves tell {told} ({by}){hint}"


def _document(
    results: Sequence[NeedleAccuracy],
    verdicts: Sequence[Judged],
    found: ClockOffset | None,
    applied_s: float | None,
    *,
    plain: bool,
) -> Any:  # noqa: ANN401 - what JSON may be
    needles = [asdict(result) for result in results]
    if plain:
        return needles
    return {
        "clock": {"applied_s": applied_s, "told": None if found is None else asdict(found)},
        "needles": needles,
        "limits": [asdict(verdict) for verdict in verdicts],
        "sources": dict(sources_of(verdicts)),
    }


def _limits_text(verdicts: Sequence[Judged]) -> str:
    if not verdicts:
        return "limits: no needle's name and unit say which recorder parameter it is"
    rows = [
        [one.needle, one.limit, one.source, f"{one.within:.1%}", f"{one.worst:.4g}", one.unit, one.verdict.value]
        for one in verdicts
    ]
    names = [f"{short}: {full}" for short, full in sources_of(verdicts).items()]
    return "\n".join([text_table(LIMITS_HEADER, rows), "", *names])


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
