"""A pool of processes that read a flight's batches, handed out in order and taken back in order.

At any time a few batches for each worker are in memory, however long the flight is. A worker that is killed takes
nothing with it: its frames are read again by a new one, first together, then one by one, until only a frame that kills
whoever reads it is left out.
"""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerContext, ForkServerProcess
from multiprocessing.reduction import send_handle
from types import TracebackType
from typing import Self

from decoder import fork_server
from decoder.errors import WorkersLost
from decoder.frame_batch import Batch, LeftOut, Outcome, RawFrame
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

    Attributes
    ----------
    deaths
        Of workers, so far.
    left_out
        Frames that could not be read because whoever read them was killed.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
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
        told, row, coming, jobs = recipe(reader), _Row(), iter(cut), deque[_Job]()
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
            yield from row.finished()

    @property
    def _busy(self) -> list[_Worker]:
        return [worker for worker in self._workers if worker.job is not None]

    def _answering(self) -> list[_Worker]:
        ready = wait([worker.connection for worker in self._busy])
        return [worker for worker in self._busy if worker.connection in ready]

    def _hand_out(self, jobs: deque[_Job], told: bytes) -> None:
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
                self._bury(worker, None)

    def _collect(self, worker: _Worker, row: _Row, jobs: deque[_Job]) -> None:
        job = worker.job
        if job is None:
            return
        try:
            outcomes = worker.answer()
        except (EOFError, OSError):
            how = self._bury(worker, job)
            job.deaths += 1
            if job.deaths < DEATHS:
                jobs.appendleft(job)
            elif len(job.frames) > 1:
                jobs.extendleft(reversed(job.one_by_one()))
            else:
                self.left_out.append(job.frames[0].sequence)
                row.fill(job, [LeftOut(f"the process that read it {how} each time")])
        else:
            self._in_a_row = 0
            row.fill(job, outcomes)

    def _bury(self, worker: _Worker, job: _Job | None) -> str:
        """Takes note of a worker that has ended; says how."""
        how = worker.last_words()
        worker.end(at_once=True)
        self._workers.remove(worker)
        frames = job.frames if job is not None else None
        self.deaths.append(Death(how, frames[0].sequence if frames else None, frames[-1].sequence if frames else None))
        self._in_a_row += 1
        if self._in_a_row > MAX_DEATHS_IN_A_ROW:
            raise WorkersLost(how)
        return how


@dataclass(slots=True)
class _Job:
    """Frames that one worker reads at a go: those of the batch `index` from `first` on."""

    index: int
    first: int
    frames: tuple[RawFrame, ...]
    deaths: int = 0

    def one_by_one(self) -> list[_Job]:
        return [_Job(self.index, self.first + count, (frame,)) for count, frame in enumerate(self.frames)]


class _Worker:
    """A process, our end of its connection, and what it is at; None if it is free."""

    def __init__(self, context: ForkServerContext) -> None:
        self.connection, theirs = context.Pipe()
        self._process: ForkServerProcess = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._pictures = PicturesGiven()
        self._is_told = False
        self.job: _Job | None = None

    def take(self, job: _Job, told: bytes) -> None:
        """Gives it a job; raises OSError if it has ended."""
        if not self._is_told:
            send_handle(self.connection, self._pictures.descriptor, self._process.pid)
            self.connection.send_bytes(told)
            self._is_told = True
        self.connection.send(self._pictures.put(job.frames))
        self.job = job

    def answer(self) -> list[Outcome]:
        """What it read; raises EOFError or OSError if it has ended."""
        outcomes: list[Outcome] = self.connection.recv()
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


class _Row:
    """The batches that are not yet given back, in order, each with what is known of its frames so far."""

    def __init__(self) -> None:
        self._begun = 0
        self._given = 0
        self._open: dict[int, tuple[Batch, dict[int, Outcome]]] = {}

    def __len__(self) -> int:
        return len(self._open)

    def begin(self, batch: Batch) -> _Job:
        """A new batch at the end of the row; gives the job of reading it."""
        self._open[self._begun] = (batch, {})
        self._begun += 1
        return _Job(self._begun - 1, 0, batch)

    def fill(self, job: _Job, outcomes: list[Outcome]) -> None:
        """What was read of a job's frames."""
        self._open[job.index][1].update(enumerate(outcomes, job.first))

    def finished(self) -> Iterator[tuple[Batch, list[Outcome]]]:
        """Takes from the row what is complete, as far as nothing before it is missing."""
        while self._given in self._open and len(self._open[self._given][1]) == len(self._open[self._given][0]):
            batch, outcomes = self._open.pop(self._given)
            self._given += 1
            yield batch, [outcomes[index] for index in range(len(batch))]
