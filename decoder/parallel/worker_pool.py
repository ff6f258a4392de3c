"""A pool of processes that read a flight's batches, returned in the flight's order.

Only a few batches per worker are in memory at any time, however long the flight is. If a worker is killed or hangs,
nothing is lost: a new one reads its batch again, first whole, then frame by frame, until only a frame that kills its
reader is left out.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator, Sized
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from itertools import chain
from types import TracebackType
from typing import Self

from decoder.imaging.thresholds import MAX_BATCH_FRAMES
from decoder.instruments.frame_batch import Batch, LeftOut, Outcome
from decoder.instruments.panel_reader import PanelReader
from decoder.panel.errors import WorkersLost
from decoder.parallel import fork_server
from decoder.parallel.fork_server import WorkerProcess
from decoder.parallel.thresholds import (
    BATCHES_HELD,
    DEATHS,
    PATIENCE_S,
    PATIENCE_TIMES,
)
from decoder.parallel.worker import Packed, begin_reading, read_packed, recipe, unpack, without_pictures

LOOK_S = 1.0
MAX_DEATHS_IN_A_ROW = DEATHS * MAX_BATCH_FRAMES  # with nothing read in between: a batch of which every frame kills
# A hang takes so long to detect that it counts as several deaths.
DEATHS_OF_A_HANG = 10


@dataclass(frozen=True, slots=True)
class Death:
    """A worker that ended, with the frames it was reading, if any."""

    how: str
    frames: Batch = ()

    def __str__(self) -> str:
        if not self.frames:
            return f"a process that reads frames {self.how}"
        first, last = self.frames[0].sequence, self.frames[-1].sequence
        return f"the process that read {f'frame {first}' if first == last else f'frames {first} to {last}'} {self.how}"


@dataclass(slots=True)
class _Task:
    """Frames that one worker reads together, or the parts that replace them; `deaths` are of workers reading it."""

    frames: Batch
    deaths: int = 0
    parts: list[_Task] = field(default_factory=list)
    read: list[Outcome] | None = None

    def outcomes(self) -> list[Outcome] | None:
        """Collect the outcomes of all its frames; None while one is missing."""
        if not self.parts:
            return self.read
        found = [part.outcomes() for part in self.parts]
        return None if None in found else list(chain.from_iterable(filter(None, found)))


@dataclass(slots=True)
class _Worker:
    """A process, its work in order, and when the first of that was started."""

    process: WorkerProcess
    held: deque[tuple[Future[list[Packed]], _Task]] = field(default_factory=deque)
    since_s: float = 0.0

    @property
    def waited_s(self) -> float:
        """How long its current work has been waited for."""
        return time.monotonic() - self.since_s


class WorkerPool:
    """Reads batches with a number of processes; for use in a `with` block, at whose end none of them is left.

    Parameters
    ----------
    patience_s
        A worker that takes this long for one batch, and fifty times as long as any batch has taken, is ended as
        hanging.

    Attributes
    ----------
    deaths
        Of workers, so far.
    left_out
        Frames that could not be read because their reader was killed.
    """

    def __init__(self, jobs: int, *, patience_s: float = PATIENCE_S) -> None:
        self._jobs = jobs
        self._patience_s = patience_s
        self._longest_s = 0.0
        self._workers: list[_Worker] = []
        self._in_a_row = 0
        self._told = b""
        self.deaths: list[Death] = []
        self.left_out: list[int] = []
        fork_server.begin()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if error is None:
            self._dismiss()
        else:
            fork_server.stop(worker.process for worker in self._workers)

    def _dismiss(self) -> None:
        for worker in self._workers:
            worker.process.dismiss()
        self._workers.clear()

    def read(self, reader: PanelReader, cut: Iterable[Batch]) -> Iterator[tuple[Batch, list[Outcome]]]:
        """Read batches, each returned in order with the outcomes of its frames.

        Raises
        ------
        WorkersLost
            If workers end one after the other.
        """
        told, coming, row = recipe(reader), iter(cut), deque[_Task]()
        if told != self._told:
            self._dismiss()  # they have another reader
            self._told = told
        while True:
            while self._has_room(row) and (batch := next(coming, None)) is not None:
                row.append(_Task(batch))
                self._hand_out(row[-1])
            if not row:
                return
            if (outcomes := row[0].outcomes()) is not None:
                yield row.popleft().frames, outcomes
            else:
                self._wait()

    def _has_room(self, row: Sized) -> bool:
        """Whether another batch may be taken: few are waiting for an older one, and a worker is free for it."""
        is_wanted = len(self._workers) < self._jobs or any(len(worker.held) < BATCHES_HELD for worker in self._workers)
        return is_wanted and len(row) < 2 * BATCHES_HELD * self._jobs

    def _hand_out(self, task: _Task) -> None:
        """Give a task to the worker with the least work, or to a new one as long as there are too few."""
        if len(self._workers) < self._jobs and all(worker.held for worker in self._workers):
            self._workers.append(self._begun())
        worker = min(self._workers, key=lambda each: len(each.held))
        try:
            future = worker.process.submit(read_packed, without_pictures(task.frames))
        except BrokenProcessPool:
            self._give_up(worker, worker.process.last_words())
            self._hand_out(task)
            return
        if not worker.held:
            worker.since_s = time.monotonic()
        worker.held.append((future, task))

    def _begun(self) -> _Worker:
        process = WorkerProcess()
        process.submit(begin_reading, self._told)
        return _Worker(process)

    def _wait(self) -> None:
        """Wait until a worker has read something, for a limited time; end workers that hang."""
        wait([worker.held[0][0] for worker in self._workers if worker.held], LOOK_S, FIRST_COMPLETED)
        for worker in [worker for worker in self._workers if worker.held]:
            if worker.held[0][0].done():
                self._collect(worker)
            elif worker.waited_s > max(self._patience_s, PATIENCE_TIMES * self._longest_s):
                worker.process.kill()
                self._give_up(worker, "did not answer any more", DEATHS_OF_A_HANG)

    def _collect(self, worker: _Worker) -> None:
        future, task = worker.held[0]
        try:
            packed = future.result()
        except BrokenProcessPool:
            self._give_up(worker, worker.process.last_words())
            return
        worker.held.popleft()
        task.read = [unpack(each) for each in packed]
        self._in_a_row = 0
        self._longest_s = max(self._longest_s, worker.waited_s)
        worker.since_s = time.monotonic()

    def _give_up(self, worker: _Worker, how: str, counts: int = 1) -> None:
        """Remove a worker that has ended, and have its work done by others.

        Raises
        ------
        WorkersLost
            If there were too many in a row.
        """
        self._workers.remove(worker)
        worker.process.dismiss()
        tasks = [task for _, task in worker.held]
        self.deaths.append(Death(how, tasks[0].frames if tasks else ()))
        self._in_a_row += counts
        if self._in_a_row > MAX_DEATHS_IN_A_ROW:
            raise WorkersLost(how)
        for task in tasks[:1]:
            task.deaths += 1
            if task.deaths == DEATHS:
                tasks = [*self._divided(task, how), *tasks[1:]]
        for task in tasks:
            self._hand_out(task)

    def _divided(self, task: _Task, how: str) -> list[_Task]:
        """Split a task that workers die of; a single frame is not tried again."""
        if len(task.frames) > 1:
            task.parts = [_Task((frame,)) for frame in task.frames]
        else:
            self.left_out.append(task.frames[0].sequence)
            task.read = [LeftOut(f"the process that read it {how} each time")]
        return task.parts
