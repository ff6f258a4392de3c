"""Processing a fleet: few flights in work at a time, however many there are, and their rows on the disk."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType
from typing import Self

import pandas as pd
import pytest

from decoder.panel.errors import ClusterLost, OutputError
from decoder.parallel.flights import FleetFlight
from decoder.parallel.index import KINDS, Index, Outcome, State, failed, from_row
from decoder.parallel.order import Order, Versions
from decoder.parallel.running import run_fleet
from tests.programs import rows_of

MANY_LOSSES = " | ".join(f"a.mcap: loss {number}" for number in range(20_000))
ORDER = Order("/out", "normxcorr", ("csv",), False, None, None, Versions("ours 1", ("numpy 2",)))


class Dead(Exception):
    """Stands for a worker that died."""


class QuickWorkers:
    """Four workers that are done at once; some flights end badly, as often as there are errors for them."""

    def __init__(self, errors: dict[str, list[BaseException]] | None = None) -> None:
        self.errors = errors or {}
        self.submitted: list[str] = []

    def room(self) -> int:
        """Four."""
        return 4

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Is done with it already."""
        assert order is ORDER
        self.submitted.append(flight.name)
        future: Future[Outcome] = Future()
        errors = self.errors.get(flight.name)
        if errors and isinstance(errors[0], CancelledError):
            future.cancel()
            future.set_running_or_notify_cancel()
        elif errors:
            future.set_exception(errors.pop(0))
        else:
            future.set_result(Outcome(flight.name, State.DECODED))
        return future

    def killed(self, error: BaseException) -> int:
        """A death kills one."""
        return int(isinstance(error, Dead))

    def __enter__(self) -> Self:
        """Nothing to start."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing to stop."""


def flights(count: int) -> Iterator[FleetFlight]:
    """So many."""
    return (FleetFlight(f"f{number:06d}", (f"/in/f{number:06d}.mcap",)) for number in range(count))


def test_flights_are_taken_as_there_is_room() -> None:
    """Of a thousand flights never more than four without an outcome are taken."""
    taken, told, most = 0, 0, 0

    def counted() -> Iterator[FleetFlight]:
        nonlocal taken, most
        for flight in flights(1000):
            taken += 1
            most = max(most, taken - told)
            yield flight

    for _ in run_fleet(counted(), ORDER, QuickWorkers()):
        told += 1

    assert (told, most) == (1000, 4)


def test_deaths_are_tried_again_once() -> None:
    """A flight whose worker dies is decoded again; one that kills two is given up; the unexpected is told."""
    errors: dict[str, list[BaseException]] = {
        "f000001": [Dead()],
        "f000002": [Dead(), Dead()],
        "f000003": [ZeroDivisionError("division by zero")],
    }
    workers = QuickWorkers(errors)
    outcomes = {outcome.flight: outcome for outcome in run_fleet(flights(6), ORDER, workers)}

    assert {name: outcome.status for name, outcome in outcomes.items()} == {
        **dict.fromkeys(["f000000", "f000001", "f000004", "f000005"], State.DECODED),
        **dict.fromkeys(["f000002", "f000003"], State.FAILED),
    }
    assert outcomes["f000002"].reason.startswith("its worker was killed 2 times over it")
    assert outcomes["f000003"].reason.startswith("unexpected ZeroDivisionError: division by zero; ")
    assert [workers.submitted.count(f"f00000{number}") for number in range(6)] == [1, 2, 2, 1, 1, 1]


def test_cancelled_flight_means_a_lost_scheduler() -> None:
    """A flight that we did not cancel was lost with the scheduler."""
    with pytest.raises(ClusterLost, match="finished flights are kept"):
        list(run_fleet(flights(1), ORDER, QuickWorkers({"f000000": [CancelledError()]})))


def indexed(folder: Path, count: int) -> int:
    """Write the index of so many failed flights, in no order; return how much memory that took at most, bytes."""
    tracemalloc.start()
    with closing(Index()) as index:
        for number in range(count):
            index.add(failed(FleetFlight(f"f{number * 7919 % count:06d}", ()), "reason " * 1000))
        index.put(str(folder), parquet=False)
        _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak_bytes


def test_index_waits_on_the_disk(tmp_path: Path) -> None:
    """Rows of 14 MB together, in any order, become a sorted index with a fifth of that in memory."""
    count = 2000
    with ProcessPoolExecutor(1, get_context("spawn")) as alone:  # nothing else allocates there
        peak_bytes = alone.submit(indexed, tmp_path, count).result()
    names = [row["flight"] for row in rows_of(tmp_path / "index.csv")]

    assert names == [f"f{number:06d}" for number in range(count)]
    assert peak_bytes < 3e6


def test_index_is_a_parquet_file_too(tmp_path: Path) -> None:
    """Where flights are decoded into Parquet the index is there as such, with the same rows."""
    with closing(Index()) as index:
        for number in (2, 1, 0):
            index.add(Outcome(f"f{number}", State.DECODED, frames=number, seconds=number / 2))
        index.put(str(tmp_path), parquet=True)
    parquet = pd.read_parquet(tmp_path / "index.parquet")
    with closing(Index()) as index:
        index.add(Outcome("f3", State.DECODED))
        index.add_earlier(str(tmp_path))
        index.put(str(tmp_path), parquet=False)

    assert list(parquet.columns) == list(KINDS)
    assert parquet[["flight", "frames", "seconds"]].to_numpy().tolist() == [
        ["f0", 0, 0.0],
        ["f1", 1, 0.5],
        ["f2", 2, 1.0],
    ]
    assert len(pd.read_parquet(tmp_path / "index.parquet")) == 4, "renewed with the other one"


def test_index_keeps_rows_of_earlier_runs(tmp_path: Path) -> None:
    """A later run adds its flights and replaces their rows, however long; a row of somebody else is left out."""
    with closing(Index()) as index:
        for name in ("b", "a"):
            index.add(Outcome(name, State.DECODED, frames=4, seconds=1.5, losses=MANY_LOSSES))
        index.add(Outcome("fl\udcffght", State.DECODED, flight_files="/a/fl\udcffght.mcap"))
        index.put(str(tmp_path), parquet=False)
    with (tmp_path / "index.csv").open("a", encoding="utf-8") as stream:
        stream.write("z,odd\n")
    with closing(Index()) as index:
        index.add(Outcome("b", State.KEPT))
        index.add(Outcome("fl\udcffght", State.KEPT))
        index.add(Outcome("c", State.FAILED, reason='says "no", twice'))
        index.add_earlier(str(tmp_path))
        rows = list(index.rows())

    assert [(row["flight"], row["status"]) for row in rows] == [
        *(("a", "decoded"), ("b", "kept"), ("c", "failed"), ("fl\\udcffght", "kept"))
    ]
    assert from_row(rows[0]) == Outcome("a", State.DECODED, frames=4, seconds=1.5, losses=MANY_LOSSES)


def test_index_of_somebody_else_is_not_replaced(tmp_path: Path) -> None:
    """A table that has the index's name and is none is left alone, with a sentence."""
    (tmp_path / "index.csv").write_text("name,phone\nAnn,1\n")
    with closing(Index()) as index, pytest.raises(OutputError, match="is no index of flights; move it away"):
        index.add_earlier(str(tmp_path))
