"""`decode accuracy FLIGHT_DATA TRUTH.csv`: the thesis's accuracy table for any needle, also against a recorder."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from decoder.commands.options import truth_options
from decoder.outputs.csv_output import text_table
from decoder.panel.vocabulary import Names, TruthRequest
from decoder.timeseries.accuracy import sources_of
from decoder.timeseries.tables import flight_table, read_table
from decoder.timeseries.truth_comparison import (
    HEADER,
    LIMITS_HEADER,
    NO_LIMITS,
    Compared,
    accuracy_rows,
    compared,
    left_out,
    limit_rows,
    offset_text,
    read_truth,
    source_lines,
)
from flight_file.untrusted import say, say_json

EPILOG = """\b
Percent columns: % of the true value (the thesis's measure; `mean` and `max` of the absolute error, `signed` of the
signed one), %FS of full scale, then in the gauge's own unit. `in95%`: frames whose error is within 1.96 sigma.

\b
A flight data recorder has its own names, units and clock:
--map      NEEDLE=COLUMN,... or a YAML file: NEEDLE: COLUMN, or NEEDLE: {name: COLUMN, unit: UNIT, factor: NUMBER}
--time     its column of times: seconds, times of the day, or ISO 8601 with a zone
--offset   what to add to its times: SECONDS, or auto to find it from the curves; without it nothing is added
--limits   judge each parameter by what regulators ask of recorders: pass if 95 % of its values are within the limit

\b
Examples:
  decode accuracy flight.csv truth.csv
  decode accuracy flight.csv truth.csv --json
  decode accuracy flight.csv fdr.csv --map names.yaml --time TIME --offset auto --limits
  decode accuracy flight.csv --map airspeed_kt=gps_speed_kt,altitude_ft=gps_altitude_ft
"""


@click.command("accuracy", epilog=EPILOG)
@click.argument("flight_data", type=click.Path(path_type=Path))
@click.argument("truth", required=False, type=click.Path(path_type=Path))
@truth_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(
    flight_data: Path,
    truth: Path | None,
    *,
    names: Names | None,
    time_column: str | None,
    offset: str | float | None,
    window_s: float,
    wants_limits: bool,
    as_json: bool,
) -> None:
    """Hold FLIGHT_DATA (the CSV that `decode` wrote) against TRUTH, a CSV whose columns are named like the needles.

    Without TRUTH it is held against its own columns of the camera's GPS, which --map names.

    Rows are matched by `frame` where both have that column, otherwise by `time_s`, the truth interpolated between its
    rows. The truth may also be a flight data recorder's, with names, units and a clock of its own.
    """
    flight = flight_table(read_table(flight_data))
    if truth is None and names is None:
        raise click.UsageError("give a TRUTH, or --map NEEDLE=gps_COLUMN to compare it with the camera's own GPS")
    request = TruthRequest(truth or flight_data, names, time_column, offset, window_s, wants_limits)
    result = compared(flight, read_truth(request))
    for name, why in left_out(flight, result).items():
        say(f"{name} left out: {why}", err=True)
    if as_json:
        plain = not (request.has_own_clock or wants_limits)
        say_json(_document(result, plain=plain))
        return
    if request.has_own_clock:
        say(*offset_text(result).split("\n"), "")
    say(*text_table(HEADER, accuracy_rows(result.accuracies)).split("\n"))
    if wants_limits:
        say("", *_limits_text(result).split("\n"))


def _document(result: Compared, *, plain: bool) -> Any:  # noqa: ANN401 - what JSON may be
    needles = [asdict(needle) for needle in result.accuracies]
    if plain:
        return needles
    return {
        "clock": {"applied_s": result.applied_s, "told": None if result.told is None else asdict(result.told)},
        "needles": needles,
        "limits": [asdict(verdict) for verdict in result.limits],
        "sources": dict(sources_of(result.limits)),
    }


def _limits_text(result: Compared) -> str:
    if not result.limits:
        return NO_LIMITS
    return "\n".join([text_table(LIMITS_HEADER, limit_rows(result.limits)), "", *source_lines(result.limits)])
