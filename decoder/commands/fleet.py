"""`decode fleet SOURCES...`: many flights into flight data and one index, on this machine or on a cluster."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from importlib.util import find_spec
from types import FrameType
from typing import NoReturn

import click
from tqdm import tqdm

from decoder.commands.options import EXIT_LOSS, format_option, images_option, method_option, refuse_unheld_images
from decoder.outputs.thresholds import MOST_LISTED
from decoder.panel.errors import FleetError
from decoder.parallel.decoding import decode_one
from decoder.parallel.flights import FleetFlight, flight_files, grouped
from decoder.parallel.index import Index, Outcome, State
from decoder.parallel.order import Order, make_order
from decoder.parallel.processes import usable_cores
from decoder.parallel.running import HomeWorkers, Workers, run_fleet
from decoder.parallel.stores import INSTALL
from flight_file.untrusted import printable, say

EXIT_DONE, EXIT_FAILED = 0, 1
LOSSY = "with loss"
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
    signal.signal(signal.SIGTERM, _interrupt)  # as Ctrl-C: processes and temporary files go, too
    flights = grouped(flight_files(sources, root))
    order = make_order(output, method=method, formats=formats, with_images=with_images, panel=panel, camera=camera)
    _write_index(Index(), order)  # an index that cannot be written fails before decoding
    sys.exit(_decode(flights, order, scheduler, jobs))


def _decode(flights: Sequence[FleetFlight], order: Order, scheduler: str | None, jobs: int | None) -> int:
    """Decode a fleet and write its index, even if interrupted; return the exit code."""
    index, counts = Index(), Counter[str]()
    try:
        with _workers(scheduler, jobs) as workers:
            for outcome in _shown(run_fleet(flights, order, workers), len(flights)):
                index.add(outcome)
                counts.update([outcome.status, *([LOSSY] if outcome.losses else [])])
                _tell(outcome, counts)
    except KeyboardInterrupt:
        say("decode: interrupted; finished flights are kept by the next run", err=True)
        return EXIT_FAILED
    finally:
        written = _write_index(index, order)
    _tell_end(counts, written)
    if counts[State.FAILED]:
        return EXIT_FAILED
    return EXIT_LOSS if counts[LOSSY] else EXIT_DONE


def _workers(scheduler: str | None, jobs: int | None) -> Workers:
    if scheduler is None:
        return HomeWorkers(jobs or usable_cores(), decode_one)
    if find_spec("distributed") is None:
        raise FleetError(f"--scheduler needs dask.distributed: {INSTALL}")
    from decoder.parallel.cluster_workers import ClusterWorkers  # noqa: PLC0415 - an extra

    return ClusterWorkers(scheduler, decode_one)


def _shown(outcomes: Iterable[Outcome], total: int) -> Iterator[Outcome]:
    """Show the number of flights done, on a terminal only."""
    return iter(tqdm(outcomes, desc="decode", total=total, unit=" flights", disable=None, leave=False, smoothing=0))


def _tell(outcome: Outcome, counts: Counter[str]) -> None:
    if outcome.status is not State.FAILED or counts[State.FAILED] > MOST_LISTED:
        return
    tqdm.write(printable(f"failed: {outcome.flight}: {outcome.reason}"), file=sys.stderr)


def _tell_end(counts: Counter[str], written: Sequence[str]) -> None:
    more = counts[State.FAILED] - MOST_LISTED
    if more > 0:
        say(f"... and {more} more failed; all are in the index", err=True)
    told = ", ".join(f"{counts[state]} {state.value}" for state in State)
    say(told, *written)


def _write_index(index: Index, order: Order) -> list[str]:
    """Write the index, with the rows that earlier runs left for other flights."""
    with closing(index):
        index.add_earlier(order.output)
        return index.put(order.output, parquet="parquet" in order.formats)


def _interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt
