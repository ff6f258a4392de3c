"""`decode accuracy FLIGHT_DATA TRUTH.csv`: the thesis's accuracy table for any needle."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from decoder.accuracy import Errors, NeedleAccuracy, compare
from decoder.tables import read_table
from decoder.text_table import text_table

HEADER = ["needle", "status", "frames", "mean%", "signed%", "max%", "mean%FS", "max%FS", "mean", "max", "unit", "in95%"]
EPILOG = """\b
Percent columns: % of the true value (the thesis's measure; `mean` and `max` of the absolute error, `signed` of the
signed one), %FS of full scale, then in the gauge's own unit. `in95%`: frames whose error is within 1.96 sigma.

\b
Examples:
  decode accuracy flight.csv truth.csv
  decode accuracy flight.csv truth.csv --json
"""


@click.command("accuracy", epilog=EPILOG)
@click.argument("flight_data", type=click.Path(path_type=Path))
@click.argument("truth", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(flight_data: Path, truth: Path, *, as_json: bool) -> None:
    """Hold FLIGHT_DATA (the CSV that `decode` wrote) against TRUTH, a CSV whose columns are named like the needles.

    Rows are matched by `frame` where both have that column, otherwise by `time_s`, the truth interpolated between its
    rows.
    """
    results = compare(read_table(flight_data), read_table(truth))
    if as_json:
        click.echo(json.dumps([asdict(result) for result in results], indent=2))
        return
    click.echo(text_table(HEADER, [_row(result, status) for result in results for status in result.by_status]))


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
