"""Speed: the CPU time of a whole decode against merely decompressing the same JPEGs, back to back in one run.

Both use one thread. A ratio of CPU times taken in turns hardly depends on the machine, or on what else it does.
"""

from __future__ import annotations

import contextlib
import io
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.flights import PLAIN
from benchmarks.programs import run
from decoder.commands.flight import command
from flight_file.reader import open_flight

TURNS = 5


@dataclass(frozen=True, slots=True)
class Turn:
    """CPU seconds for one flight: JPEGs to grey, a decode inside a running process, and `decode` from its start."""

    decompression_s: float
    decode_s: float
    program_s: float


@dataclass(frozen=True, slots=True)
class Speed:
    """Medians over the turns; ratios are medians of each turn's own ratio."""

    frames: int
    turns: int
    decompression_s: float
    decode_s: float
    program_s: float
    ratio: float
    program_ratio: float


def measure_speed(flight: Path = PLAIN) -> Speed:
    """Takes turns between decompressing and decoding one flight."""
    cv2.setNumThreads(1)
    jpegs = [frame.jpeg for frame in open_flight([flight]).frames()]
    with threadpool_limits(1), TemporaryDirectory() as folder:
        turns = [_turn(flight, jpegs, folder) for _ in range(TURNS + 1)][1:]  # the first one warms up
    return Speed(
        frames=len(jpegs),
        turns=len(turns),
        decompression_s=statistics.median(turn.decompression_s for turn in turns),
        decode_s=statistics.median(turn.decode_s for turn in turns),
        program_s=statistics.median(turn.program_s for turn in turns),
        ratio=statistics.median(turn.decode_s / turn.decompression_s for turn in turns),
        program_ratio=statistics.median(turn.program_s / turn.decompression_s for turn in turns),
    )


def _turn(flight: Path, jpegs: list[bytes], folder: str) -> Turn:
    return Turn(
        decompression_s=_cpu_s(lambda: _decompress(jpegs)),
        decode_s=_cpu_s(lambda: _decode(flight, folder)),
        program_s=run("decode", flight, "-o", folder).cpu_s,
    )


def _decompress(jpegs: list[bytes]) -> None:
    for jpeg in jpegs:
        cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


def _decode(flight: Path, folder: str) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        command.main([str(flight), "-o", folder], standalone_mode=False)


def _cpu_s(work: Callable[[], None]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started
