"""`recorder info`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from flight_file.reader import open_flight
from recorder.failures import DONE_WITH_LOSS, FAILED, failures_as_sentences
from recorder.info import inspect
from recorder.info_text import as_json, as_text


@click.command(
    epilog="""\b
Examples:
  recorder info flights/20180504T120000Z_*.mcap
  recorder info --json flights/20180504T120000Z_0000.mcap.part | jq .losses

\b
Exit codes: 0 all is there, 1 nothing can be read, 2 wrong usage, 3 something is lost.""",
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--json", "as_document", is_flag=True, help="Print a JSON document instead of a page.")
@click.pass_context
def info(context: click.Context, files: tuple[Path, ...], *, as_document: bool) -> None:
    """Say what is in a flight: times, frames, gaps, camera, zoom, attachments, and what is lost.

    Several segments of one recording are one flight. All of it is read, and every digest checked.
    """
    with failures_as_sentences():
        found = inspect(open_flight(files))
    click.echo(json.dumps(as_json(found), indent=2) if as_document else as_text(found))
    if not found.facts.frames:
        click.echo("Error: no picture in it can be read.", err=True)
        context.exit(FAILED)
    context.exit(DONE_WITH_LOSS if found.losses else 0)
