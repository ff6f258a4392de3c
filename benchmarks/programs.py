"""Running `decode` as its users do, and what that costs."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

FIXTURES = Path(__file__).parents[1] / "fixtures"
RENDERED = FIXTURES / "rendered"


@dataclass(frozen=True, slots=True)
class Cost:
    """What one run of a program took: processor seconds, and peak resident memory in MiB."""

    cpu_s: float
    peak_mib: float


def decode(flight: Path, folder: Path, *words: str) -> Cost:
    """Decodes a flight into a folder.

    Raises
    ------
    SystemExit
        If the flight is not there, or `decode` fails.
    """
    if not flight.exists():
        raise SystemExit(f"{flight} is not there; make it with: make fixtures")
    command = [str(Path(sys.executable).parent / "decode"), str(flight), "-o", str(folder), *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        _, status, usage = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
    if running.returncode != 0:
        raise SystemExit(f"decode {flight} ended with {running.returncode}")
    return Cost(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)
