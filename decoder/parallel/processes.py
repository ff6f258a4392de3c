"""How `decode` begins: how many processes read, one library thread in each, and Ctrl-C while modules are imported.

Until the libraries are loaded, there is nothing to clean up, so Ctrl-C ends the process immediately: an exception would
have to pass through half-imported libraries, and would show their traceback.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from decoder.parallel.thresholds import MAX_JOBS, MIN_SHARED_BYTES

EXIT_FAILED = 1
INTERRUPTED = "decode: interrupted; nothing was written"

CPU_QUOTA = Path("/sys/fs/cgroup/cpu.max")

ONE_EACH = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""For the environment of a process before it imports numpy; later is too late."""


def jobs_for(picture_bytes: int, *, asked: int | None) -> int:
    """Return as many as were asked for; otherwise as many as there are cores, or one if there is little to read."""
    if asked is not None:
        return asked
    return 1 if picture_bytes < MIN_SHARED_BYTES else min(usable_cores(), MAX_JOBS)


def usable_cores() -> int:
    """Count the cores that this process may use, by its affinity and by its control group's quota."""
    return max(1, min(len(os.sched_getaffinity(0)), _quota_cores(CPU_QUOTA)))


def _quota_cores(file: Path) -> int:
    try:
        quota, period = file.read_text(encoding="ascii").split()
    except (OSError, ValueError):
        return sys.maxsize
    return sys.maxsize if quota == "max" else int(quota) // int(period)


@contextmanager
def ends_at_once() -> Iterator[None]:
    """Make Ctrl-C end the process with a sentence inside the `with` block; for imports, by the main thread only.

    If something else handles Ctrl-C, or it is ignored, that is left unchanged.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(_signal: int, _frame: FrameType | None) -> None:
    os.write(2, f"{INTERRUPTED}\n".encode())
    os._exit(EXIT_FAILED)
