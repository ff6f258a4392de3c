"""What `decode fleet` does once it knows what was asked for: it decodes, tells what failed, and writes the index."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from types import FrameType
from typing import NoReturn

import click
from tqdm import tqdm

from decoder.errors import FleetError
from decoder.fleet.flights import grouped
from decoder.fleet.index import Index
from decoder.fleet.order import make_order
from decoder.fleet.outcome import Outcome, State
from decoder.fleet.running import run_fleet
from decoder.fleet.sources import flight_files
from decoder.fleet.stores import INSTALL
from decoder.fleet.workers import Workers
from decoder.jobs import usable_cores

EXIT_DONE, EXIT_FAILED, EXIT_LOSS = 0, 1, 3
MAX_LISTED = 10
LOSSY = "with loss"


@dataclass(frozen=True, slots=True)
class Asked:
    """What the command line says, but for who decodes."""

    sources: tuple[str, ...]
    root: str | None
    output: str
    method: str
    formats: tuple[str, ...]
    with_images: bool
    panel: str | None
    camera: str | None


def decode_fleet(asked: Asked, *, scheduler: str | None, jobs: int | None) -> int:
    """Decodes a fleet and writes its index, whatever ends it; returns the exit code.

    Raises
    ------
    DecoderError
        If it cannot be begun, or not gone on with.
    """
    signal.signal(signal.SIGTERM, _interrupt)  # as Ctrl-C: processes and temporary files go, too
    flights = grouped(flight_files(asked.sources, asked.root))
    order = make_order(
        asked.output,
        method=asked.method,
        formats=asked.formats,
        with_images=asked.with_images,
        panel=asked.panel,
        camera=asked.camera,
    )
    parquet = "parquet" in asked.formats
    _write_index(Index(), order.output, parquet=parquet)  # what cannot be written is told before anything is decoded
    index, counts = Index(), Counter[str]()
    try:
        with _workers(scheduler, jobs) as workers:
            for outcome in _shown(run_fleet(flights, order, workers), len(flights)):
                index.add(outcome)
                counts.update([outcome.status, *([LOSSY] if outcome.losses else [])])
                _tell(outcome, counts)
    except KeyboardInterrupt:
        click.echo("decode: interrupted; finished flights are kept by the next run", err=True)
        return EXIT_FAILED
    finally:
        written = _write_index(index, order.output, parquet=parquet)
    _tell_end(counts, written)
    if counts[State.FAILED]:
        return EXIT_FAILED
    return EXIT_LOSS if counts[LOSSY] else EXIT_DONE


def _workers(scheduler: str | None, jobs: int | None) -> Workers:
    if scheduler is None:
        from decoder.fleet.home_workers import HomeWorkers  # noqa: PLC0415 - one of both is needed

        return HomeWorkers(jobs or usable_cores())
    if find_spec("distributed") is None:
        raise FleetError(f"--scheduler needs dask.distributed: {INSTALL}")
    from decoder.fleet.cluster_workers import ClusterWorkers  # noqa: PLC0415 - an extra

    return ClusterWorkers(scheduler)


def _shown(outcomes: Iterable[Outcome], total: int) -> Iterator[Outcome]:
    """Shows how many flights went by, on a terminal only."""
    return iter(tqdm(outcomes, desc="decode", total=total, unit=" flights", disable=None, leave=False, smoothing=0))


def _tell(outcome: Outcome, counts: Counter[str]) -> None:
    if outcome.status is not State.FAILED or counts[State.FAILED] > MAX_LISTED:
        return
    tqdm.write(f"failed: {outcome.flight}: {outcome.reason}", file=sys.stderr)


def _tell_end(counts: Counter[str], written: Sequence[str]) -> None:
    more = counts[State.FAILED] - MAX_LISTED
    if more > 0:
        click.echo(f"... and {more} more failed; all are in the index", err=True)
    told = ", ".join(f"{counts[state]} {state.value}" for state in State)
    click.echo(f"{told}\n" + "\n".join(written))


def _write_index(index: Index, output: str, *, parquet: bool) -> list[str]:
    """Writes the index, with the rows that earlier runs left for other flights."""
    with index:
        index.add_earlier(output)
        return index.put(output, parquet=parquet)


def _interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt
