"""Starting processes that read frames, long before they are needed; imports nothing that takes time.

They are forked from a process that has the libraries loaded and no threads: forking this one would copy its threads'
locks, and starting each afresh would load the libraries each time. Ctrl-C is for this process alone to deal with.
"""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, get_context, resource_tracker
from multiprocessing.context import ForkServerContext

from decoder.thread_limits import ONE_EACH

PRELOADED = ["decoder.worker"]
# Of the 107 bytes that a socket's path may have, multiprocessing takes some thirty for names below this folder.
LONGEST_FOLDER = 70
SHORT_FOLDER = "/tmp"  # noqa: S108 - multiprocessing makes a folder in it that is nobody else's


def begin() -> ForkServerContext:
    """Starts the process that others are forked from, unless it runs, and comes back without waiting for it."""
    context = get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    resource_tracker.ensure_running()  # the fork server would start it, which lets held interrupts go
    with interrupts_held(), _environment(ONE_EACH), _temporary_folder_for_sockets():
        # a thread pool that a fork leaves behind must never have been made
        forkserver.ensure_running()
    return context


@contextmanager
def interrupts_held() -> Iterator[None]:
    """What is started in the `with` block never hears of Ctrl-C: it inherits the mask."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _temporary_folder_for_sockets() -> Iterator[None]:
    """A socket's path may not be long, but TMPDIR may."""
    before = tempfile.gettempdir()
    if len(os.fsencode(before)) > LONGEST_FOLDER:
        tempfile.tempdir = SHORT_FOLDER
    try:
        yield
    finally:
        tempfile.tempdir = before


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
