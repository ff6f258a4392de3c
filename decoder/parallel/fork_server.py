"""Worker processes, each forked from a server that has the libraries loaded; imports nothing that takes time.

Forking this process would copy its threads' locks, and starting each worker from scratch would load the libraries each
time. Ctrl-C is handled by this process alone.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import forkserver, get_context, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerContext, ForkServerProcess
from types import FrameType
from typing import Any, ParamSpec, TypeVar

from decoder.parallel.processes import ONE_EACH

PRELOADED = ["decoder.parallel.worker"]
SHORT_FOLDER = "/tmp"  # noqa: S108 - multiprocessing makes a private folder in it
PATIENCE_S = 20.0  # for a process that was told to stop, on a busy machine; then it is killed
CLEAN_UP_S = 3.0  # for a process that was told to stop, or whose parent is gone

P = ParamSpec("P")
R = TypeVar("R")


def begin() -> ForkServerContext:
    """Start the process that others are forked from, unless it is running, and return without waiting for it."""
    context = get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    os.environ.update(ONE_EACH)  # thread pools must not exist before a fork
    resource_tracker.ensure_running()  # else the fork server would start it, and release held interrupts
    with interrupts_held(), _temporary_folder_for_sockets():
        forkserver.ensure_running()
    return context


class _RememberingContext(ForkServerContext):
    """Remembers the process that was last made in it, which may die before anybody can look it up."""

    made: ForkServerProcess

    def Process(self, *arguments: Any, **options: Any) -> ForkServerProcess:  # type: ignore[override]  # noqa: N802, ANN401
        self.made = ForkServerProcess(*arguments, **options)
        return self.made


class WorkerProcess:
    """A process that does one thing after another.

    It has its own pool. A process that dies breaks its pool, and a broken pool loses all its work; so only this
    process's work is lost with it, and it is known which that was.
    """

    def __init__(self) -> None:
        begin()
        context = _RememberingContext()
        with interrupts_held():  # an interrupt here would leave the new process waiting for the rest of its input
            self._pool = ProcessPoolExecutor(1, context, _begin_worker)
            self._pool.submit(_clean_up_when_told)  # starts it
        self._process = context.made

    def submit(self, work: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> Future[R]:
        """Have it call a function; raises BrokenProcessPool if the process has ended."""
        return self._pool.submit(partial(_until_told, work, *arguments, **options))

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def last_words(self) -> str:
        """Say how it ended; only for one that has."""
        self._pool.shutdown()  # waits for the process
        code = self._process.exitcode
        return f"was killed ({signal.Signals(-code).name})" if code and code < 0 else f"ended with exit code {code}"

    def end(self, until: float) -> None:
        """Wait until it has ended, and kill it if it has not by `until` (monotonic seconds)."""
        if not wait([self._process.sentinel], max(0.0, until - time.monotonic())):
            self._process.kill()
        self._pool.shutdown(cancel_futures=True)

    def dismiss(self) -> None:
        """Let it finish its work, and end."""
        self._pool.shutdown()

    def tell_to_stop(self) -> None:
        """Have it stop its work, and clean up."""
        self._process.terminate()


def stop(workers: Iterable[WorkerProcess]) -> None:
    """Stop processes whatever they are doing; none of them is left."""
    workers = list(workers)
    for worker in workers:
        worker.tell_to_stop()
    until = time.monotonic() + PATIENCE_S
    for worker in workers:
        worker.end(until)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Block Ctrl-C for whatever is started in the `with` block, which inherits the mask, and for the block itself.

    The mask alone is not enough for the block: a library's thread may take the signal, and the main thread is notified.
    """
    pressed: list[int] = []
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    handler = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number)) if is_main else None
    try:
        yield
    finally:
        if is_main:
            signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in pressed[:1]:
            signal.raise_signal(number)


@contextmanager
def _temporary_folder_for_sockets() -> Iterator[None]:
    """Have sockets made in a folder with a short path, since their paths are limited and TMPDIR may be long."""
    before = tempfile.gettempdir()
    tempfile.tempdir = SHORT_FOLDER
    try:
        yield
    finally:
        tempfile.tempdir = before


def _begin_worker() -> None:
    """Set up a new process: it ends when told to, or when the parent is gone; Ctrl-C is left to the parent.

    Until it has something to clean up it ends at once, because an exception in here would be printed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _clean_up_when_told() -> None:
    signal.signal(signal.SIGTERM, _leave)


class _ToldToStop(SystemExit):
    """Raised in the middle of a process's work, so that temporary folders are removed on the way out."""


def _leave(_number: int, _frame: FrameType | None) -> None:
    """Leave the current work; the pool's own loop swallows exceptions in some places, and would wait for more work."""
    threading.Thread(target=_end_soon, daemon=True).start()
    raise _ToldToStop(1)


def _end_soon() -> None:
    time.sleep(CLEAN_UP_S)
    os._exit(1)


def _until_told(work: Callable[P, R], *arguments: P.args, **options: P.kwargs) -> R:
    """Call a function, and end the process if it was told to stop meanwhile.

    Its pool would take the exception for a result, and wait for more work until it is killed.
    """
    try:
        return work(*arguments, **options)
    except _ToldToStop:
        os._exit(1)


def _follow(parent: int) -> None:
    wait([parent])
    os.kill(os.getpid(), signal.SIGTERM)
    _end_soon()
