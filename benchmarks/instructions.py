"""Instructions of the reading path for one frame, by valgrind: a figure that does not depend on the machine's load.

`python -m benchmarks.instructions` counts and compares with what is committed; --write commits the new figures. A
count is the difference of two processes, one of which is forked from the other and reads each frame once more: starting
up, which costs more than all the reading, is done once and in both. Valgrind shows programs a processor of its own
without AVX-512, so machines with AVX2 give the same figures to a percent or so.
"""

from __future__ import annotations

import json
import os
import pickle
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
from threadpoolctl import threadpool_limits

from decoder.flight_fitting import fit_to_flight
from decoder.frame_batch import Batch, batches, read_batch
from decoder.method import Method
from decoder.panel_pictures import panel_from_attachments
from decoder.panel_reader import PanelReader
from decoder.pictures import FramePicture, grey_picture
from flight_file.reader import Flight, open_flight

FLIGHT = Path(__file__).parents[1] / "fixtures" / "thesis_a2.mcap"
COMMITTED = Path(__file__).with_name("instructions.json")
MAX_GROWTH = 1.1
FRAMES = 16
KINDS = ("read", "decompress")
# The same code whatever the machine: one thread, the library's AVX2 code, one order of hashes.
ENVIRONMENT = {
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "PYTHONDONTWRITEBYTECODE": "1",
}


def has_valgrind() -> bool:
    """Whether instructions can be counted here."""
    return shutil.which("valgrind") is not None


def count(kinds: tuple[str, ...] = KINDS) -> dict[str, float]:
    """Millions of instructions a frame of 1024 x 768 with seven needles: to read it, and to decompress it alone."""
    with TemporaryDirectory() as name, ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        recipe = Path(name) / "recipe"
        recipe.write_bytes(_recipe())
        counts = dict(zip(kinds, pool.map(partial(_instructions, recipe), kinds), strict=True))
    return {kind: round(counts[kind] / FRAMES / 1e6, 3) for kind in kinds}


def committed() -> dict[str, float]:
    """The figures that new ones are held against."""
    figures: dict[str, float] = json.loads(COMMITTED.read_text(encoding="utf-8"))["million_instructions_a_frame"]
    return figures


def growth(kind: str) -> float:
    """The count now, in parts of the committed one."""
    return count((kind,))[kind] / committed()[kind]


def _recipe() -> bytes:
    """A reader that is fitted to the flight already."""
    flight = open_flight([FLIGHT])
    panel = panel_from_attachments(flight.attachments, flight=FLIGHT.name)
    with threadpool_limits(1):
        reader = fit_to_flight(PanelReader.from_panel(panel, Method.NORMXCORR), partial(_sample, flight)).reader
    return pickle.dumps((reader.source, reader.method, reader.tuning))


def _sample(flight: Flight, frames: int) -> list[FramePicture]:
    return [
        FramePicture(grey_picture(frame.jpeg), frame.exif.focal_length_mm) for frame in flight.sample_frames(frames)
    ]


def _instructions(recipe: Path, kind: str) -> int:
    """Of the child beyond those of its parent."""
    command = [
        *("valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"),
        *(sys.executable, "-m", __spec__.name, kind, str(recipe)),
    ]
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}
    environment = {**inherited, **ENVIRONMENT}
    ran = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    found = [int(refs.replace(",", "")) for refs in re.findall(r"I\s+refs:\s+([\d,]+)", ran.stderr)]
    if len(found) != len(("child", "parent")):
        raise RuntimeError(f"valgrind gave no count: {ran.stderr[-500:]}")
    return max(found) - min(found)


def _work(kind: str, recipe: Path) -> None:
    """What is counted: a batch, read or decompressed once, and by a child of this process once more."""
    cv2.setNumThreads(1)
    with threadpool_limits(1):
        reader = PanelReader(*pickle.loads(recipe.read_bytes()))  # noqa: S301 - our own, made a moment ago
        batch = next(batches(open_flight([FLIGHT]).frames(), FRAMES))
        works: dict[str, Callable[[], object]] = {
            "read": partial(read_batch, reader, batch),
            "decompress": partial(_decompress, batch),
        }
        work = works[kind]
        work()
        child = os.fork()
        if child == 0:
            work()
        else:
            os.waitpid(child, 0)


def _decompress(batch: Batch) -> None:
    for frame in batch:
        grey_picture(frame.jpeg)


def _document(figures: dict[str, float]) -> str:
    libraries = {name: version(name) for name in ("numpy", "opencv-python-headless", "simplejpeg")}
    document = {
        "flight": FLIGHT.name,
        "million_instructions_a_frame": figures,
        "python": platform.python_version(),
        "machine": platform.machine(),
        **libraries,
    }
    return json.dumps(document, indent=2) + "\n"


def main(words: list[str]) -> None:
    """Counts, compares and, with --write, commits."""
    if len(words) > 1:
        _work(words[0], Path(words[1]))
        return
    if not has_valgrind():
        sys.exit("instructions are counted by valgrind, which is not here: apt-get install valgrind")
    figures = count()
    before = committed() if COMMITTED.exists() else {}
    for kind, figure in figures.items():
        sys.stdout.write(f"{kind}: {figure:.2f} million instructions a frame; committed: {before.get(kind, 0.0):.2f}\n")
    if "--write" in words:
        COMMITTED.write_text(_document(figures), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
