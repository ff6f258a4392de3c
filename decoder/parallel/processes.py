"""How many processes read a flight, and how many threads of their own the libraries have in each: one."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from decoder.parallel.thresholds import MAX_JOBS, MIN_SHARED_BYTES

CPU_QUOTA = Path("/sys/fs/cgroup/cpu.max")

ONE_EACH = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""For the environment of a process before it imports numpy; later is too late."""


def jobs_for(picture_bytes: int, *, asked: int | None) -> int:
    """As many as were asked for; otherwise as many as there are cores, and one where there is little to read."""
    if asked is not None:
        return asked
    return 1 if picture_bytes < MIN_SHARED_BYTES else min(usable_cores(), MAX_JOBS)


def usable_cores() -> int:
    """Cores that this process may use, by its affinity and by its control group's quota."""
    return max(1, min(len(os.sched_getaffinity(0)), _quota_cores(CPU_QUOTA)))


def _quota_cores(file: Path) -> int:
    try:
        quota, period = file.read_text(encoding="ascii").split()
    except (OSError, ValueError):
        return sys.maxsize
    return sys.maxsize if quota == "max" else int(quota) // int(period)
