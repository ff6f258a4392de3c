"""A pool of real processes: the same readings as without, in the same order, whoever is killed on the way."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from decoder.batch_row import Job
from decoder.errors import WorkersLost
from decoder.frame_batch import Batch, LeftOut, read_here
from decoder.method import Method
from decoder.panel_reader import PanelReader
from decoder.worker_pool import BATCHES_AHEAD, WorkerPool
from decoder.worker_process import WorkerProcess

SUICIDE = "__import__('os').kill(__import__('os').getpid(), 9)"
SLEEP = "__import__('time').sleep(3600)"


class Deadly(float):
    """A focal length that kills the process that receives it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return eval, (SUICIDE,)


class DeadlyOnce(float):
    """A focal length that kills the first process that receives it; `flag` is made then."""

    flag: Path

    def __reduce__(self) -> tuple[Any, ...]:
        died = f"__import__('os').path.exists({str(self.flag)!r})"
        return eval, (f"{float(self)!r} if {died} else (open({str(self.flag)!r}, 'x'), {SUICIDE})",)


class HangsOnce(DeadlyOnce):
    """A focal length over which the first process that receives it hangs; `flag` is made then."""

    def __reduce__(self) -> tuple[Any, ...]:
        hung = f"__import__('os').path.exists({str(self.flag)!r})"
        return eval, (f"{float(self)!r} if {hung} else (open({str(self.flag)!r}, 'x'), {SLEEP})",)


@dataclass(frozen=True, slots=True)
class Fitted:
    """As in conftest.py."""

    reader: Any
    batches: tuple[Batch, ...]


def taken_at(batch: Batch, index: int, focal_length_mm: float) -> Batch:
    """The batch with one of its frames taken at another zoom."""
    return (*batch[:index], replace(batch[index], focal_length_mm=focal_length_mm), *batch[index + 1 :])


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_readings_are_those_of_one_process(fitted: Fitted, jobs: int) -> None:
    """Every bit and the order are the same, whatever the number of workers."""
    with WorkerPool(jobs) as pool:
        assert list(pool.read(fitted.reader, fitted.batches)) == list(read_here(fitted.reader, fitted.batches))
        assert pool.deaths == []


def test_frame_that_kills_is_left_out_alone(fitted: Fitted) -> None:
    """The frames beside it in its batch are read by others; it is missing, with the reason."""
    deadly = (fitted.batches[0], taken_at(fitted.batches[1], 2, Deadly()), *fitted.batches[2:])
    with WorkerPool(2) as pool:
        outcomes = [outcome for _, some in pool.read(fitted.reader, deadly) for outcome in some]
    whole = [outcome for _, some in read_here(fitted.reader, fitted.batches) for outcome in some]

    assert outcomes[6] == LeftOut("the process that read it was killed (SIGKILL) each time")
    assert outcomes[:6] + outcomes[7:] == whole[:6] + whole[7:]
    assert pool.left_out == [6]
    assert [str(death) for death in pool.deaths] == [
        *["the process that read frames 4 to 7 was killed (SIGKILL)"] * 2,
        *["the process that read frame 6 was killed (SIGKILL)"] * 2,
    ]


def test_worker_that_is_killed_once_costs_nothing(fitted: Fitted, tmp_path: Path) -> None:
    """Its frames are read again, together, so that the result is the same to the bit."""
    zoom = DeadlyOnce(fitted.batches[2][1].focal_length_mm or math.nan)
    zoom.flag = tmp_path / "died"
    deadly = (*fitted.batches[:2], taken_at(fitted.batches[2], 1, zoom), *fitted.batches[3:])
    with WorkerPool(2) as pool:
        outcomes = [outcome for _, some in pool.read(fitted.reader, deadly) for outcome in some]

    assert outcomes == [outcome for _, some in read_here(fitted.reader, fitted.batches) for outcome in some]
    assert [str(death) for death in pool.deaths] == ["the process that read frames 8 to 11 was killed (SIGKILL)"]
    assert pool.left_out == []


def test_worker_that_hangs_is_ended_and_costs_nothing(
    fitted: Fitted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After some patience its frames are read again by another, as if it had died; it is told which it held."""
    monkeypatch.setattr("decoder.worker_pool.PATIENCE_TIMES", 4)
    zoom = HangsOnce(fitted.batches[2][1].focal_length_mm or math.nan)
    zoom.flag = tmp_path / "hung"
    hanging = (*fitted.batches[:2], taken_at(fitted.batches[2], 1, zoom), *fitted.batches[3:])
    with WorkerPool(2, patience_s=1.0) as pool:
        outcomes = [outcome for _, some in pool.read(fitted.reader, hanging) for outcome in some]

    assert outcomes == [outcome for _, some in read_here(fitted.reader, fitted.batches) for outcome in some]
    assert "the process that read frames 8 to 11 did not answer any more" in [str(death) for death in pool.deaths]
    assert pool.left_out == []


def test_slow_machine_is_no_hanging_worker(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """However short the patience, a worker has many times as long as batches have taken so far."""
    monkeypatch.setattr("decoder.worker_pool.PATIENCE_TIMES", 10**6)
    with WorkerPool(1, patience_s=math.inf) as pool:
        list(pool.read(fitted.reader, fitted.batches[:1]))
        pool._patience_s = 0.0
        list(pool.read(fitted.reader, fitted.batches[1:]))

    assert pool.deaths == []


def test_worker_that_is_killed_while_it_waits_is_replaced(fitted: Fitted) -> None:
    """Whoever ends between two batches held no frame."""
    with WorkerPool(1) as pool:
        outcomes = list(pool.read(fitted.reader, fitted.batches[:1]))
        (child,) = multiprocessing.active_children()
        assert child.pid is not None
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        outcomes += pool.read(fitted.reader, fitted.batches[1:2])

    assert outcomes == list(read_here(fitted.reader, fitted.batches[:2]))
    assert [str(death) for death in pool.deaths] == ["a process that reads frames was killed (SIGKILL)"]


def test_batch_that_waited_in_a_killed_worker_is_read_by_another(fitted: Fitted) -> None:
    """Only the frames that it was at count as those over which it ended."""
    outcomes = []
    with WorkerPool(1) as pool:
        for read in pool.read(fitted.reader, fitted.batches[:4]):
            if not outcomes:
                (child,) = multiprocessing.active_children()
                assert child.pid is not None
                os.kill(child.pid, signal.SIGKILL)
                child.join()
            outcomes.append(read)

    assert outcomes == list(read_here(fitted.reader, fitted.batches[:4]))
    assert len(pool.deaths) == 1
    assert pool.left_out == []


@pytest.mark.parametrize("batches", [1, 4, 5])
def test_last_frames_are_shared_by_all(fitted: Fitted, batches: int) -> None:
    """Wherever batches end, the last is read in parts, and given back as it was."""
    some = fitted.batches[:batches]
    with WorkerPool(3) as pool:
        assert list(pool.read(fitted.reader, some)) == list(read_here(fitted.reader, some))
        assert len(multiprocessing.active_children()) == 3


def test_first_and_last_batches_are_taken_in_parts(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first by all workers, so that none waits; the last one frame by frame, so that all end together."""
    sizes: list[int] = []
    take = WorkerProcess.take

    def noted(self: WorkerProcess, job: Job, told: bytes) -> None:
        sizes.append(len(job.frames))
        take(self, job, told)

    monkeypatch.setattr(WorkerProcess, "take", noted)
    with WorkerPool(2) as pool:
        assert list(pool.read(fitted.reader, fitted.batches[:8])) == list(read_here(fitted.reader, fitted.batches[:8]))

    assert sizes[:2] == [2, 2]
    assert set(sizes[2:-4]) == {4}
    assert sizes[-4:] == [1, 1, 1, 1]


def test_pool_gives_up_when_it_is_not_the_frames(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where workers do nothing but end, somebody has to look."""
    monkeypatch.setattr("decoder.worker_pool.MAX_DEATHS_IN_A_ROW", 3)
    deadly = tuple(taken_at(batch, 0, Deadly()) for batch in fitted.batches)
    with pytest.raises(WorkersLost, match=r"was killed \(SIGKILL\); try --jobs 1"), WorkerPool(1) as pool:
        list(pool.read(fitted.reader, deadly))
    assert multiprocessing.active_children() == []


def test_few_batches_are_in_memory(fitted: Fitted) -> None:
    """However long the flight is, frames are taken from it only as fast as they are read."""
    taken, given = 0, 0

    def flight() -> Iterator[Batch]:
        nonlocal taken
        for batch in fitted.batches * 6:
            taken += 1
            assert taken - given <= 2 * BATCHES_AHEAD + 2
            yield batch

    with WorkerPool(2) as pool:
        for _ in pool.read(fitted.reader, flight()):
            given += 1
    assert given == taken == 6 * len(fitted.batches)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_nobody_is_left_when_the_reading_is_broken_off(fitted: Fitted, stop: type[BaseException]) -> None:
    """Whatever ends the `with` block, its processes end with it."""

    def broken_off() -> None:
        with WorkerPool(2) as pool:
            for _ in pool.read(fitted.reader, fitted.batches):
                assert multiprocessing.active_children() != []
                raise stop

    with pytest.raises(stop):
        broken_off()
    assert multiprocessing.active_children() == []


def test_pool_reads_with_the_reader_it_is_given(fitted: Fitted) -> None:
    """One flight after the other, each with its own reader."""
    other = PanelReader.from_panel(fitted.reader.source, Method.XCORR)
    with WorkerPool(1) as pool:
        for reader in (fitted.reader, other, fitted.reader):
            assert list(pool.read(reader, fitted.batches[:1])) == list(read_here(reader, fitted.batches[:1]))
        assert pool.deaths == []


def test_no_frames_need_no_process(fitted: Fitted) -> None:
    """A flight without frames starts nobody."""
    with WorkerPool(2) as pool:
        assert list(pool.read(fitted.reader, ())) == []
        assert multiprocessing.active_children() == []
