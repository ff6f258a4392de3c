"""`recorder extract`."""

from __future__ import annotations

from pathlib import Path

import click

from flight_file.reader import open_flight
from recorder.failures import DONE_WITH_LOSS, failures_as_sentences
from recorder.replaying import extract as extract_pictures


@click.command(
    epilog="""\b
Examples:
  recorder extract flights/20180504T120000Z_*.mcap -o photographs

\b
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 something of the flight is lost.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "directory", type=click.Path(path_type=Path), required=True, metavar="FOLDER",
    help="Where the pictures go.",
)  # fmt: skip
@click.pass_context
def extract(context: click.Context, files: tuple[Path, ...], directory: Path) -> None:
    """Take the pictures out of a flight, byte for byte as they were recorded, named by their number."""
    with failures_as_sentences():
        flight = open_flight(files)
        count = sum(1 for _ in extract_pictures(flight, directory))
    click.echo(f"{directory}: {count} pictures")
    for loss in flight.losses:
        click.echo(f"  lost: {loss.reason}", err=True)
    context.exit(DONE_WITH_LOSS if flight.losses else 0)
