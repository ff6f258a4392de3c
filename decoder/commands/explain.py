"""`decode explain FLIGHT_DATA NAME --frame N`: how sure one value is, and why."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from decoder.outputs.explanation import explained, explanation_text, row_at, row_of_frame
from decoder.timeseries.tables import Table, flight_table, read_table
from flight_file.untrusted import say, say_json

EPILOG = """\b
Examples:
  decode explain results/flight.csv oil_press_psi --frame 57
  decode explain results/flight.csv heading_deg --at 14.25 --json
"""


@click.command("explain", epilog=EPILOG)
@click.argument("flight_data", type=click.Path(path_type=Path))
@click.argument("name")
@click.option("--frame", type=int, help="The frame, by its number in the recording.")
@click.option("--at", "at_s", type=float, help="Or the frame nearest to this time, in seconds as in `time_s`.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for a script to read.")
def command(flight_data: Path, name: str, *, frame: int | None, at_s: float | None, as_json: bool) -> None:
    """Tell how sure the value of column NAME is in one frame, and why.

    FLIGHT_DATA is the CSV that `decode` wrote; what is told comes from it and from the files beside it: what the
    uncertainty is made of, how well the gauge is drawn, when it was last seen, and what other instruments say.
    """
    if (frame is None) == (at_s is None):
        raise click.UsageError("give --frame or --at")
    flight = flight_table(read_table(flight_data))
    row = row_of_frame(flight, frame) if frame is not None else row_at(flight, at_s or 0.0)
    told = explained(flight, name, row, _alignments(flight_data))
    if as_json:
        say_json(asdict(told))
    else:
        say(*explanation_text(told).split("\n"))


def _alignments(flight_data: Path) -> Table | None:
    """Read the panel's place in each frame, if that was written and still exists."""
    path = flight_data.with_name(f"{flight_data.stem}_alignment.tsv")
    return read_table(path, "\t") if path.is_file() else None
