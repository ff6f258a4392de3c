"""Our own programs as processes, and what they cost."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

PROGRAMS = Path(sys.executable).parent
_CHILD = """
import sys
from decoder.cli import main
try:
    main()
except SystemExit as done:
    if done.code:
        raise
with open("/proc/self/status", encoding="ascii") as status:
    print(next(line for line in status if line.startswith("VmHWM")))
"""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a process took: CPU time of user and system together, and time on the wall."""

    cpu_s: float
    wall_s: float


def run(program: str, *words: object) -> Cost:
    """Runs a program to its end; it must succeed."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([str(PROGRAMS / program), *map(str, words)], check=True, capture_output=True)
    wall_s, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    return Cost(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall_s)


def peak_memory_mib(*words: object) -> float:
    """The most memory that `decode` held at once.

    The process says it itself (VmHWM), since what the system reports of a child includes the parent that started it.
    """
    command = [sys.executable, "-c", _CHILD, *map(str, words)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024
