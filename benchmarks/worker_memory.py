"""What a process that reads frames holds at most, for short and long flights of small and large pictures."""

from __future__ import annotations

import multiprocessing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.sized_flights import SIZES, Repeated, Size, sized_flight
from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.imaging.picture_block import batch_frames
from decoder.instruments.frame_batch import batches
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.parallel.worker_pool import WorkerPool
from flight_file.reader import Flight

JOBS = 2
NEEDLES = 7
SMALL, *_, LARGE = SIZES
MEASURED = (replace(SMALL, frames=400), replace(SMALL, frames=40_000), replace(LARGE, frames=100))


@dataclass(frozen=True, slots=True)
class Held:
    """The most resident memory of any worker, MiB."""

    size: Size
    peak_mib: float


def worker_memory(measured: tuple[Size, ...] = MEASURED) -> list[Held]:
    """Of two workers that read a flight of so many frames."""
    held = []
    with TemporaryDirectory() as name:
        flights: dict[str, Flight] = {}
        for size in measured:
            if size.name not in flights:
                flights[size.name] = sized_flight(Path(name), size, NEEDLES)
            held.append(Held(size, _peak_mib(Repeated(flights[size.name], size.frames))))
    return held


def _peak_mib(flight: Flight) -> float:
    source = panel_from_attachments(flight.attachments, flight="flight")
    height, width = source.picture.shape
    cut = batches(flight.frames(), batch_frames((width, height)))
    with WorkerPool(JOBS) as pool:
        for _ in pool.read(reader_from_panel(source, Method.NORMXCORR), cut):
            pass
        return max(_high_water_mib(child.pid or 0) for child in multiprocessing.active_children())


def _high_water_mib(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    (line,) = (line for line in lines if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024
