"""A process that reads frames, as whoever hands them out sees it: it holds the job that it is at, and the next one."""

from __future__ import annotations

import signal
from collections import deque
from multiprocessing.context import ForkServerContext, ForkServerProcess
from multiprocessing.reduction import send_handle

from decoder import fork_server
from decoder.answers import understood
from decoder.batch_row import Job
from decoder.frame_batch import Outcome
from decoder.shared_pictures import PicturesGiven
from decoder.worker import BATCHES_HELD, serve

END_S = 2.0


class WorkerProcess:
    """A process, our end of its connection, the jobs it holds, and how long the first of them was waited for."""

    def __init__(self, context: ForkServerContext) -> None:
        self.connection, theirs = context.Pipe()
        self._process: ForkServerProcess = context.Process(target=serve, args=(theirs,), daemon=True)
        # Interrupted here, the new process would wait for the rest of what it is to do, and end in a traceback.
        with fork_server.interrupts_held():
            self._process.start()
        theirs.close()
        self._memories = [PicturesGiven() for _ in range(BATCHES_HELD)]
        self._is_told = False
        self._is_deaf = False
        self.jobs = deque[Job]()
        self.waited_s = 0.0

    @property
    def has_room(self) -> bool:
        """Whether it may be given one job more."""
        return len(self.jobs) < BATCHES_HELD and not self._is_deaf

    @property
    def is_alive(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.is_alive()

    def take(self, job: Job, told: bytes) -> None:
        """Gives it a job; raises OSError if it has ended."""
        try:
            if not self._is_told:
                for memory in self._memories:
                    send_handle(self.connection, memory.descriptor, self._process.pid)
                self.connection.send_bytes(told)
                self._is_told = True
            memory = self._memories[0]
            self.connection.send(memory.put(job.frames))
        except OSError:
            self._is_deaf = True
            raise
        self._memories = [*self._memories[1:], memory]
        if not self.jobs:
            self.waited_s = 0.0
        self.jobs.append(job)

    def answer(self) -> list[Outcome]:
        """What it read of its first job; raises EOFError or OSError if it has ended."""
        outcomes = [understood(each) for each in self.connection.recv()]
        self.jobs.popleft()
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
        for memory in self._memories:
            memory.close()
        if not at_once:
            self._process.join(END_S)
        self._process.kill()
        self._process.join()
        self._process.close()
