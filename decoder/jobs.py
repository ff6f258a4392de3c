"""How many processes read a flight."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# One process hands out frames to all others; more than this would wait for it.
MAX_JOBS = 8
# Loading the libraries once more takes as long as reading some hundred small frames, or some ten large ones.
MIN_SHARED_BYTES = 48 * 2**20
CPU_QUOTA = Path("/sys/fs/cgroup/cpu.max")


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
