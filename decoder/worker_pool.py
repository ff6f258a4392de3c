"""A pool of processes that read a flight's batches, handed out in order and taken back in order.

At any time a few batches for each worker are in memory, however long the flight is. A worker that is killed, or that
hangs, takes nothing with it: its frames are read again by a new one, first together, then one by one, until only a
frame that kills whoever reads it is left out.
"""

from __future__ import annotations

import signal
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerContext, ForkServerProcess
from multiprocessing.reduction import send_handle
from types import TracebackType
from typing import Self

from decoder import fork_server
from decoder.answers import understood
from decoder.batch_row import BatchRow, Job
from decoder.errors import WorkersLost
from decoder.frame_batch import Batch, LeftOut, Outcome
from decoder.panel_reader import PanelReader
from decoder.shared_pictures import PicturesGiven
from decoder.worker import recipe, serve

# Frames that have taken two workers with them are read one by one; one that takes two more is left out.
DEATHS = 2
# So many workers one after the other, and nothing read between them: then it is not the frames.
MAX_DEATHS_IN_A_ROW = 80
# Batches that may wait for an older one, for each worker.
BATCHES_AHEAD = 4
END_S = 2.0
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
        self._workers: list[_Worker] = []
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
        if told != self._told:
            self._dismiss(at_once=False)  # they know another reader
            self._told = told
        while True:
            self._hand_out(jobs, told)
            while len(jobs) < self._jobs and len(row) < BATCHES_AHEAD * self._jobs and (batch := next(coming, None)):
                jobs.append(row.begin(batch))
            if jobs and len(self._busy) < self._jobs:
                continue
            if not self._busy:
                return
            for worker in self._answering():
                self._collect(worker, row, jobs)
            for worker in self._hanging():
                self._give_up(worker, "did not answer any more", row, jobs)
            yield from row.finished()

    @property
    def _busy(self) -> list[_Worker]:
        return [worker for worker in self._workers if worker.job is not None]

    def _answering(self) -> list[_Worker]:
        begun_s = time.monotonic()
        ready = wait([worker.connection for worker in self._busy], LOOK_S)
        # More than a look is time in which this process was stopped itself.
        waited_s = min(time.monotonic() - begun_s, 2 * LOOK_S)
        for worker in self._busy:
            worker.waited_s += waited_s
        return [worker for worker in self._busy if worker.connection in ready]

    def _hanging(self) -> list[_Worker]:
        limit_s = max(self._patience_s, PATIENCE_TIMES * self._longest_s)
        return [worker for worker in self._busy if worker.waited_s > limit_s]

    def _hand_out(self, jobs: deque[Job], told: bytes) -> None:
        """Gives waiting jobs to workers that are free, and to new ones as long as there are too few."""
        while jobs:
            free = [worker for worker in self._workers if worker.job is None]
            if not free and len(self._workers) == self._jobs:
                return
            if not free:
                self._workers.append(_Worker(self._context))
            worker = free[0] if free else self._workers[-1]
            job = jobs.popleft()
            try:
                worker.take(job, told)
            except OSError:  # it ended while it was free
                jobs.appendleft(job)
                self._bury(worker, None, worker.last_words())

    def _collect(self, worker: _Worker, row: BatchRow, jobs: deque[Job]) -> None:
        job = worker.job
        if job is None:
            return
        try:
            outcomes = worker.answer()
        except (EOFError, OSError):
            self._give_up(worker, worker.last_words(), row, jobs)
        else:
            self._in_a_row = 0
            self._longest_s = max(self._longest_s, worker.waited_s)
            row.fill(job, outcomes)

    def _give_up(self, worker: _Worker, how: str, row: BatchRow, jobs: deque[Job]) -> None:
        """Ends a worker that does not read its job to the end, and has the job read again, or what is left of it."""
        job = worker.job
        if job is None:
            return
        self._bury(worker, job, how)
        job.deaths += 1
        if job.deaths < DEATHS:
            jobs.appendleft(job)
        elif len(job.frames) > 1:
            jobs.extendleft(reversed(job.one_by_one()))
        else:
            self.left_out.append(job.frames[0].sequence)
            row.fill(job, [LeftOut(f"the process that read it {how} each time")])

    def _bury(self, worker: _Worker, job: Job | None, how: str) -> None:
        """Takes note of a worker that has ended, or has to; raises WorkersLost if there were too many in a row."""
        self._in_a_row += DEATHS_OF_A_HANG if worker.is_alive else 1
        worker.end(at_once=True)
        self._workers.remove(worker)
        frames = job.frames if job is not None else None
        self.deaths.append(Death(how, frames[0].sequence if frames else None, frames[-1].sequence if frames else None))
        if self._in_a_row > MAX_DEATHS_IN_A_ROW:
            raise WorkersLost(how)


class _Worker:
    """A process, our end of its connection, what it is at (None if it is free), and how long that was waited for."""

    def __init__(self, context: ForkServerContext) -> None:
        self.connection, theirs = context.Pipe()
        self._process: ForkServerProcess = context.Process(target=serve, args=(theirs,), daemon=True)
        with (
            fork_server.interrupts_held()
        ):  # or the new process waits for the rest of what it is to do, and ends in a traceback
            self._process.start()
        theirs.close()
        self._pictures = PicturesGiven()
        self._is_told = False
        self.job: Job | None = None
        self.waited_s = 0.0

    @property
    def is_alive(self) -> bool:
        return self._process.is_alive()

    def take(self, job: Job, told: bytes) -> None:
        """Gives it a job; raises OSError if it has ended."""
        if not self._is_told:
            send_handle(self.connection, self._pictures.descriptor, self._process.pid)
            self.connection.send_bytes(told)
            self._is_told = True
        self.connection.send(self._pictures.put(job.frames))
        self.job = job
        self.waited_s = 0.0

    def answer(self) -> list[Outcome]:
        """What it read; raises EOFError or OSError if it has ended."""
        outcomes = [understood(each) for each in self.connection.recv()]
        self.job = None
        return outcomes

    def last_words(self) -> str:
        """How it ended; for one that has."""
        self._process.join(END_S)
        code = self._process.exitcode
        if code is None:
            return "hung up"
        return f"was killed ({signal.Signals(-code).name})" if code < 0 else f"ended with exit code {code}"

    def end(self, *, at_once: bool) -> None:
        """Ends the process, if it has not ended by itself."""
        self.connection.close()
        self._pictures.close()
        if not at_once:
            self._process.join(END_S)
        self._process.kill()
        self._process.join()
        self._process.close()
