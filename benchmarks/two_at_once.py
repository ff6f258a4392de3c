"""What two processes can do at once on this machine: merely decompressing, which share nothing."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

# Decompresses into memory of its own, which it has used before, each time that it is told to.
_DECOMPRESS_WHEN_TOLD = """
import sys
from itertools import islice
from pathlib import Path
from decoder.imaging.picture_block import PictureBlock
from flight_file.reader import open_flight

jpegs = [frame.encoded for frame in islice(open_flight([Path(sys.argv[1])]).frames(), int(sys.argv[2]))]
block = PictureBlock()
for jpeg in jpegs[:2]:
    block.grey_picture(jpeg, 0)
print("ready", flush=True)
for _ in sys.stdin:
    for number in range(int(sys.argv[3])):
        block.grey_picture(jpegs[number % len(jpegs)], 0)
    print("done", flush=True)
"""


@contextmanager
def decompressing(flight: Path, pictures: int, frames: int) -> Iterator[Callable[[], float]]:
    """Gives what tells, each time it is asked, how much sooner two processes have decompressed frames than one has.

    Wall clock; `pictures` of the flight are taken again and again.
    """
    command = [sys.executable, "-c", _DECOMPRESS_WHEN_TOLD, str(flight), str(pictures), str(frames // 2)]
    both = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    try:
        for process in both:
            _hear(process)
        yield lambda: 2.0 * _took_s(both[:1]) / _took_s(both)
    finally:
        for process in both:
            process.communicate()


def _took_s(processes: Sequence[subprocess.Popen[str]]) -> float:
    """Until all of them have done their half."""
    start = time.perf_counter()
    for process in processes:
        told, _ = _pipes(process)
        told.write("\n")
        told.flush()
    for process in processes:
        _hear(process)
    return time.perf_counter() - start


def _hear(process: subprocess.Popen[str]) -> None:
    _, said = _pipes(process)
    if not said.readline():
        raise SystemExit(f"a process that decompresses ended with {process.wait()}")


def _pipes(process: subprocess.Popen[str]) -> tuple[IO[str], IO[str]]:
    if process.stdin is None or process.stdout is None:
        raise SystemExit("a process that decompresses was started without pipes")
    return process.stdin, process.stdout
