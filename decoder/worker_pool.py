"""A pool of processes that read a flight's batches, handed out in order and taken back in order.

At any time a few batches for each worker are in memory, however long the flight is. A worker that is killed, or that
hangs, takes nothing with it: its frames are read again by a new one, first together, then one by one, until only a
frame that kills whoever reads it is left out.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from types import TracebackType
from typing import Self

from decoder import fork_server
from decoder.batch_row import BatchRow, Job
from decoder.errors import WorkersLost
from decoder.frame_batch import Batch, LeftOut, Outcome
from decoder.panel_reader import PanelReader
from decoder.worker import recipe
from decoder.worker_process import WorkerProcess

# In the end a worker takes one of so many parts of its share of what is left.
PARTS_AT_END = 2
# Frames that have taken two workers with them are read one by one; one that takes two more is left out.
DEATHS = 2
# So many workers one after the other, and nothing read between them: then it is not the frames.
MAX_DEATHS_IN_A_ROW = 80
# Batches that may wait for an older one, for each worker.
BATCHES_AHEAD = 4
# A batch takes a fraction of a second. A worker hangs that is at one for so long, and for so many times as long as any
# batch has taken: on a slow or busy machine all of them take longer.
PATIENCE_S = 300.0
PATIENCE_TIMES = 50
LOOK_S = 1.0
# Waiting for one that hangs takes so much longer that fewer in a row are enough: as many as so many deaths.
DEATHS_OF_A_HANG = 10


@dataclass(frozen=True, slots=True)
class Death:
    """A worker that ended, with the frames it held (None: it held none)."""

    how: str
    first_frame: int | None
    last_frame: int | None

    def __str__(self) -> str:
        if self.first_frame is None:
            return f"a process that reads frames {self.how}"
        held = f"{self.first_frame}"
        held = f"frame {held}" if self.first_frame == self.last_frame else f"frames {held} to {self.last_frame}"
        return f"the process that read {held} {self.how}"


class WorkerPool:
    """Reads batches with so many processes; for use in a `with` block, at whose end none of them is left.

    Parameters
    ----------
    patience_s
        A worker that is at one batch for so long, and for fifty times as long as any batch has taken, is ended as one
        that hangs.

    Attributes
    ----------
    deaths
        Of workers, so far.
    left_out
        Frames that could not be read because whoever read them was killed.
    """

    def __init__(self, jobs: int, *, patience_s: float = PATIENCE_S) -> None:
        self._jobs = jobs
        self._patience_s = patience_s
        self._longest_s = 0.0
        self._context = fork_server.begin()
        self._workers: list[WorkerProcess] = []
        self._in_a_row = 0
        self._told = b""
        self.deaths: list[Death] = []
        self.left_out: list[int] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._dismiss(at_once=kind is not None)

    def _dismiss(self, *, at_once: bool) -> None:
        for worker in self._workers:
            worker.end(at_once=at_once)
        self._workers.clear()

    def read(self, reader: PanelReader, cut: Iterable[Batch]) -> Iterator[tuple[Batch, list[Outcome]]]:
        """Each batch, in order, with what was read of its frames.

        Raises
        ------
        WorkersLost
            If workers end one after the other.
        """
        told, row, coming, jobs = recipe(reader), BatchRow(), iter(cut), deque[Job]()
        is_all_taken = False
        if told != self._told:
            self._dismiss(at_once=False)  # they know another reader
            self._told = told
        while True:
            self._hand_out(jobs, told)
            if not is_all_taken and len(jobs) < self._jobs and len(row) < BATCHES_AHEAD * self._jobs:
                batch = next(coming, None)
                is_all_taken = batch is None
                jobs.extend(self._evenly(jobs) if batch is None else self._begun(row.begin(batch)))
                continue
            if jobs and self._has_room:
                continue
            if not self._busy:
                return
            for worker in self._answering():
                self._collect(worker, row, jobs)
            for worker in self._hanging():
                self._give_up(worker, "did not answer any more", row, jobs)
            yield from row.finished()

    @property
    def _busy(self) -> list[WorkerProcess]:
        return [worker for worker in self._workers if worker.jobs]

    @property
    def _has_room(self) -> bool:
        return len(self._workers) < self._jobs or any(worker.has_room for worker in self._workers)

    def _begun(self, job: Job) -> list[Job]:
        """A new job; in parts as long as no worker has anything to do, so that all begin with the first."""
        return [job] if self._busy else job.in_parts(self._jobs)

    def _evenly(self, jobs: deque[Job]) -> list[Job]:
        """Takes the last jobs, and gives them in parts, ever smaller ones: so all workers end at about the same time.

        Guided self-scheduling (Polychronopoulos and Kuck, IEEE Trans. Computers 36, 1987).
        """
        parts: list[Job] = []
        left = sum(len(job.frames) for job in jobs)
        while jobs:
            job = jobs.popleft()
            parts += job.in_parts(math.ceil(len(job.frames) * PARTS_AT_END * self._jobs / left))
            left -= len(job.frames)
        return parts

    def _answering(self) -> list[WorkerProcess]:
        begun_s = time.monotonic()
        ready = wait([worker.connection for worker in self._busy], LOOK_S)
        # More than a look is time in which this process was stopped itself.
        waited_s = min(time.monotonic() - begun_s, 2 * LOOK_S)
        for worker in self._busy:
            worker.waited_s += waited_s
        return [worker for worker in self._busy if worker.connection in ready]

    def _hanging(self) -> list[WorkerProcess]:
        limit_s = max(self._patience_s, PATIENCE_TIMES * self._longest_s)
        return [worker for worker in self._busy if worker.waited_s > limit_s]

    def _hand_out(self, jobs: deque[Job], told: bytes) -> None:
        """Gives waiting jobs to workers that have room, and to new ones as long as there are too few."""
        while jobs:
            if len(self._busy) == len(self._workers) < self._jobs:
                self._workers.append(WorkerProcess(self._context))
            open_ = [worker for worker in self._workers if worker.has_room]
            if not open_:
                return
            worker = min(open_, key=lambda each: len(each.jobs))
            job = jobs.popleft()
            try:
                worker.take(job, told)
            except OSError:  # it has ended; what it held is seen to when its answers are collected
                jobs.appendleft(job)
                if not worker.jobs:
                    self._bury(worker, None, worker.last_words())

    def _collect(self, worker: WorkerProcess, row: BatchRow, jobs: deque[Job]) -> None:
        if not worker.jobs:
            return
        job = worker.jobs[0]
        try:
            outcomes = worker.answer()
        except (EOFError, OSError):
            self._give_up(worker, worker.last_words(), row, jobs)
        else:
            self._in_a_row = 0
            self._longest_s = max(self._longest_s, worker.waited_s)
            worker.waited_s = 0.0
            row.fill(job, outcomes)

    def _give_up(self, worker: WorkerProcess, how: str, row: BatchRow, jobs: deque[Job]) -> None:
        """Ends a worker that does not read its job to the end, and has the job read again, or what is left of it."""
        if not worker.jobs:
            return
        job, *untouched = worker.jobs
        self._bury(worker, job, how)
        jobs.extendleft(reversed(untouched))
        job.deaths += 1
        if job.deaths < DEATHS:
            jobs.appendleft(job)
        elif len(job.frames) > 1:
            jobs.extendleft(reversed(job.one_by_one()))
        else:
            self.left_out.append(job.frames[0].sequence)
            row.fill(job, [LeftOut(f"the process that read it {how} each time")])

    def _bury(self, worker: WorkerProcess, job: Job | None, how: str) -> None:
        """Takes note of a worker that has ended, or has to; raises WorkersLost if there were too many in a row."""
        self._in_a_row += DEATHS_OF_A_HANG if worker.is_alive else 1
        worker.end(at_once=True)
        self._workers.remove(worker)
        frames = job.frames if job is not None else None
        self.deaths.append(Death(how, frames[0].sequence if frames else None, frames[-1].sequence if frames else None))
        if self._in_a_row > MAX_DEATHS_IN_A_ROW:
            raise WorkersLost(how)
