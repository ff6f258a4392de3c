"""A pool of real processes: the same readings as without, in the same order, whoever is killed on the way."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from decoder.instruments.frame_batch import Batch, LeftOut
from decoder.panel.errors import WorkersLost
from decoder.parallel import fork_server
from decoder.parallel.fork_server import WorkerProcess, _begin_worker, _leave, begin, interrupts_held
from decoder.parallel.thresholds import BATCHES_HELD
from decoder.parallel.worker_pool import WorkerPool
from tests.programs import until

Fitted = Any
SUICIDE = "__import__('os').kill(__import__('os').getpid(), 9)"
SLEEP = "__import__('time').sleep(3600)"


class Deadly(float):
    """A focal length that kills the process that receives it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return eval, (SUICIDE,)


class HarmfulOnce(float):
    """A focal length that kills the first process that receives it, or over which it hangs; `flag` is made then."""

    flag: Path
    harm: str

    def __reduce__(self) -> tuple[Any, ...]:
        done = f"__import__('os').path.exists({str(self.flag)!r})"
        return eval, (f"{float(self)!r} if {done} else (open({str(self.flag)!r}, 'x'), {self.harm})",)


def taken_at(batch: Batch, index: int, focal_length_mm: float) -> Batch:
    """The batch with one of its frames taken at another zoom."""
    return (*batch[:index], replace(batch[index], focal_length_mm=focal_length_mm), *batch[index + 1 :])


@pytest.mark.parametrize("jobs", [1, 3])
def test_readings_are_those_of_one_process(fitted: Fitted, jobs: int) -> None:
    """Every bit and the order are the same, whatever the number of workers."""
    with WorkerPool(jobs) as pool:
        assert list(pool.read(fitted.reader, fitted.batches)) == fitted.results
        assert pool.deaths == []


def test_frame_that_kills_is_left_out_alone(fitted: Fitted) -> None:
    """The frames beside it in its batch are read by others; it is missing, with the reason."""
    deadly = (fitted.batches[0], taken_at(fitted.batches[1], 2, Deadly()), *fitted.batches[2:])
    with WorkerPool(2) as pool:
        outcomes = [outcome for _, some in pool.read(fitted.reader, deadly) for outcome in some]
    whole = [outcome for _, some in fitted.results for outcome in some]

    assert outcomes[6] == LeftOut("the process that read it was killed (SIGKILL) each time")
    assert outcomes[:6] + outcomes[7:] == whole[:6] + whole[7:]
    assert pool.left_out == [6]
    assert [str(death) for death in pool.deaths] == [
        *["the process that read frames 4 to 7 was killed (SIGKILL)"] * 2,
        *["the process that read frame 6 was killed (SIGKILL)"] * 2,
    ]


@pytest.mark.parametrize(
    ("harm", "patience_s", "says"),
    [(SUICIDE, math.inf, "was killed (SIGKILL)"), (SLEEP, 3.0, "did not answer any more")],
    ids=["killed", "hangs"],
)
def test_worker_that_is_lost_once_costs_nothing(
    fitted: Fitted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, harm: str, patience_s: float, says: str
) -> None:
    """Its frames are read again by another, together, so that no bit is another; patience ends a hang."""
    monkeypatch.setattr("decoder.parallel.worker_pool.PATIENCE_TIMES", 4)
    zoom = HarmfulOnce(fitted.batches[2][1].focal_length_mm or math.nan)
    zoom.flag, zoom.harm = tmp_path / "harmed", harm
    harmed = (*fitted.batches[:2], taken_at(fitted.batches[2], 1, zoom), *fitted.batches[3:])
    with WorkerPool(2, patience_s=patience_s) as pool:
        outcomes = [outcome for _, some in pool.read(fitted.reader, harmed) for outcome in some]

    assert outcomes == [outcome for _, some in fitted.results for outcome in some]
    assert f"the process that read frames 8 to 11 {says}" in [str(death) for death in pool.deaths]
    assert len(pool.deaths) == 1 or harm is SLEEP
    assert pool.left_out == []


def test_slow_machine_is_no_hanging_worker(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """However short the patience, a worker has many times as long as batches have taken so far."""
    monkeypatch.setattr("decoder.parallel.worker_pool.PATIENCE_TIMES", 10**6)
    with WorkerPool(1, patience_s=math.inf) as pool:
        list(pool.read(fitted.reader, fitted.batches[:1]))
        pool._patience_s = 0.0
        list(pool.read(fitted.reader, fitted.batches[1:]))

    assert pool.deaths == []


@pytest.mark.parametrize("after", [1, 2])
def test_worker_that_is_killed_from_outside_is_replaced(fitted: Fitted, after: int) -> None:
    """Whatever it held or waited for, all is read."""
    outcomes = []
    with WorkerPool(1) as pool:
        for read in pool.read(fitted.reader, fitted.batches[:4]):
            outcomes.append(read)
            if len(outcomes) == after:
                (child,) = multiprocessing.active_children()
                child.kill()

    assert outcomes == fitted.results[:4]
    assert len(pool.deaths) == 1
    assert pool.left_out == []


def test_pool_gives_up_when_it_is_not_the_frames(fitted: Fitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """If workers keep ending, a person must look."""
    monkeypatch.setattr("decoder.parallel.worker_pool.MAX_DEATHS_IN_A_ROW", 3)
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
            assert taken - given <= 4 * BATCHES_HELD + 2
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


def test_interrupt_waits_even_if_another_thread_takes_it() -> None:
    """A library's thread does not block the signal; the block is finished all the same, and then interrupted."""
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    finished: list[str] = []
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, set())

    def start_a_worker() -> None:
        with interrupts_held():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)  # the main thread would be told here
            finished.append("started")

    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            start_a_worker()
    finally:
        done.set()
        thread.join()
    assert finished == ["started"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, set()) == mask


def test_process_that_is_stopped_while_it_begins_ends_at_once() -> None:
    """Told to stop before there is anything to clean up, it must raise nothing, since its pool would print it."""
    with ProcessPoolExecutor(1, begin(), _begin_worker) as beginning:
        assert beginning.submit(signal.getsignal, signal.SIGTERM).result() == signal.SIG_DFL

    begun = WorkerProcess()
    assert begun.submit(signal.getsignal, signal.SIGTERM).result() is _leave
    begun.dismiss()


def test_process_that_dies_as_it_begins_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be gone before anybody can look for it; what it is given fails, and it says how it ended."""
    monkeypatch.setattr(fork_server, "_clean_up_when_told", os.abort)
    worker = WorkerProcess()
    with pytest.raises(BrokenProcessPool):
        worker.submit(os.getpid).result()

    assert worker.last_words() == "was killed (SIGABRT)"


def test_process_that_is_stopped_in_its_work_ends_by_itself(tmp_path: Path) -> None:
    """Its pool takes what ends the work for a result; the process must not go on to the next work."""
    worker = WorkerProcess()
    worker.submit(os.mkdir, tmp_path / "at work")
    for _ in range(2):
        worker.submit(time.sleep, 600.0)
    until((tmp_path / "at work").exists)

    worker.tell_to_stop()
    worker.end(time.monotonic() + fork_server.PATIENCE_S)

    assert worker.last_words() == "ended with exit code 1"
