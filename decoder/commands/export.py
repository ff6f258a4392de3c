"""`decode export FLIGHT_DATA -o FILE`: flight data in another program's format."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import click

from decoder.outputs.outputs import Write, as_text, refuse_overwriting, write_all
from decoder.panel.errors import OutputError
from decoder.timeseries.tables import FlightTable, MappedName, flight_table, read_mapping, read_table
from flight_file.untrusted import say

EPILOG = """\b
parquet  all columns of the CSV, typed, with units and the description; needs the extra `parquet`
garmin   the log of a Garmin G1000, one row a second, for flight-analysis sites: what was read, edge or hidden, in
         the columns that the needles' names (or --map) give; no position, no status, no uncertainty

\b
Examples:
  decode export results/flight.csv -o flight.parquet
  decode export results/flight.csv -o flight_g1000.csv
  decode export results/flight.csv -o flight_g1000.csv --map names.yaml
"""
SUFFIXES = {".parquet": "parquet", ".csv": "garmin"}


def _parquet(flight: FlightTable, _mapping: dict[str, MappedName]) -> Write:
    if find_spec("pyarrow") is None:
        raise OutputError("parquet needs pyarrow: pip install 'image-flight-recorder[parquet]'")
    from decoder.outputs.parquet_output import write_parquet_of_table  # noqa: PLC0415 - half a second that only this needs

    return partial(write_parquet_of_table, flight)


def _garmin(flight: FlightTable, mapping: dict[str, MappedName]) -> Write:
    from decoder.outputs.garmin_output import plan, write_garmin  # noqa: PLC0415 - as above

    planned = plan(flight, mapping)
    for one in planned.chosen:
        say(f"{one.needle} as {one.column.name} ({one.column.unit_text})")
    for name, reason in planned.left_out.items():
        say(f"{name} left out: {reason}", err=True)
    return as_text(partial(write_garmin, flight, planned.chosen))


WRITERS: dict[str, Callable[[FlightTable, dict[str, MappedName]], Write]] = {"parquet": _parquet, "garmin": _garmin}


@click.command("export", epilog=EPILOG)
@click.argument("flight_data", type=click.Path(path_type=Path))
@click.option("-o", "--output", "file", type=click.Path(path_type=Path), required=True, metavar="FILE")
@click.option("--to", "kind", type=click.Choice(list(WRITERS)), help="The format, if FILE's name does not show it.")
@click.option("--map", "map_file", type=click.Path(path_type=Path), metavar="YAML", help="Which column each needle is.")
def command(flight_data: Path, file: Path, kind: str | None, map_file: Path | None) -> None:
    """Write FLIGHT_DATA (the CSV that `decode` wrote, with its JSON beside it) to FILE in another format.

    A name that ends with .parquet asks for parquet, one that ends with .csv for garmin.
    """
    chosen = kind or SUFFIXES.get(file.suffix.lower())
    if chosen is None:
        raise click.UsageError(f"{file}: the name does not show the format; give it with --to {' or '.join(WRITERS)}")
    if file.exists() and flight_data.exists() and file.samefile(flight_data):
        raise click.UsageError(f"{file}: is the flight data itself; choose another name with -o")
    refuse_overwriting([flight_data, flight_data.with_suffix(".json"), *([map_file] if map_file else [])], [file])
    flight = flight_table(read_table(flight_data))
    mapping = {} if map_file is None else read_mapping(map_file)
    (written,) = write_all(file.parent, {file.name: WRITERS[chosen](flight, mapping)})
    say(str(written))
