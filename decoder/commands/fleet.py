"""`decode fleet SOURCES...`: many flights into flight data and one index, on this machine or on a cluster."""

from __future__ import annotations

import sys

import click

from decoder.commands.decode_options import format_option, images_option, method_option, refuse_unheld_images
from decoder.interrupts import ends_at_once

EPILOG = """\b
Exit codes: 0 done, 1 failed or some flights failed, 2 wrong usage, 3 done with loss (flight files are damaged).

\b
Examples:
  decode fleet 'archive/*/*.mcap' -o results
  decode fleet @flights.txt -o results --jobs 8 --panel cockpit/panel.yaml
  decode fleet 's3://flights/2026/**/*.mcap' -o s3://results/2026 --scheduler tcp://scheduler:8786
"""


@click.command("fleet", epilog=EPILOG)
@click.argument("sources", nargs=-1, required=True, metavar="SOURCES...")
@click.option(
    "-o", "--output", required=True, metavar="URL",
    help="Where results go: a folder, or a URL such as s3://bucket/results.",
)  # fmt: skip
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Decode on the workers of this dask scheduler.")
@click.option(
    "--jobs", type=click.IntRange(min=1), metavar="N", help="Processes on this machine.  [default: one for each core]"
)
@click.option(
    "--root", metavar="FOLDER",
    help="Flights are named by their place below it.  [default: the part of a pattern before its first * ? or [...]]",
)  # fmt: skip
@click.option(
    "--panel", metavar="PANEL", help="A panel.yaml to read with, instead of the ones that the flight files carry."
)
@click.option(
    "--camera", metavar="CAMERA", help="A camera.yaml to use instead of the ones that the flight files carry."
)
@method_option
@format_option
@images_option
def command(
    *,
    sources: tuple[str, ...],
    output: str,
    scheduler: str | None,
    jobs: int | None,
    root: str | None,
    panel: str | None,
    camera: str | None,
    method: str,
    formats: tuple[str, ...],
    with_images: bool,
) -> None:
    """Decode all flights in SOURCES: flight files, patterns in quotes, URLs, and @LIST, a file with one on each line.

    Segments of one recording are one flight. Each flight's results are a folder in the output, which is there whole or
    not at all; index.csv has a row for every flight. A second run keeps what is finished.
    """
    refuse_unheld_images(formats, with_images=with_images)
    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine; a cluster has as many as its workers have threads")
    with ends_at_once():
        from decoder.commands.fleet_work import Asked, decode_fleet  # noqa: PLC0415 - what takes time to import
    asked = Asked(
        sources=sources,
        root=root,
        output=output,
        method=method,
        formats=formats,
        with_images=with_images,
        panel=panel,
        camera=camera,
    )
    sys.exit(decode_fleet(asked, scheduler=scheduler, jobs=jobs))
