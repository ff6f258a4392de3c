"""How soon `decode` says something: processor time and wall clock from its start, the least of several runs."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.programs import RENDERED

RUNS = 15


@dataclass(frozen=True, slots=True)
class Start:
    """Seconds until the first line of output: of the processor, and on the clock."""

    words: str
    processor_s: float
    wall_s: float


def starts() -> list[Start]:
    """Of the program's help, and of decoding a flight."""
    with TemporaryDirectory() as folder:
        decode = ["decode", str(RENDERED / "plain.mcap"), "-o", folder]
        return [_start("decode --help", ["decode", "--help"]), _start("decode FLIGHT", decode)]


def _start(words: str, command: list[str]) -> Start:
    runs = [_first_line(command) for _ in range(RUNS)]
    return Start(words, min(processor for processor, _ in runs), min(wall for _, wall in runs))


def _first_line(command: list[str]) -> tuple[float, float]:
    program = str(Path(sys.executable).parent / command[0])
    start = time.perf_counter()
    running = subprocess.Popen([program, *command[1:]], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    if running.stdout is None:
        raise SystemExit("a program without its output")
    running.stdout.readline()
    wall_s = time.perf_counter() - start
    running.kill()
    _, _, used = os.wait4(running.pid, 0)
    running.returncode = 0
    running.stdout.close()
    return used.ru_utime + used.ru_stime, wall_s
