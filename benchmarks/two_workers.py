"""How much sooner two workers have read a flight than one process, where the machine has two processors to give.

On a shared machine two processes that share nothing gain from nearly nothing to twice as much, from one minute to the
next. So that is measured right before and after two workers read, and rounds count in which it was given.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

from benchmarks.sized_flights import PICTURES, Size
from benchmarks.two_at_once import decompressing
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.picture_block import batch_frames
from decoder.instruments.frame_batch import ReadBatches, batches, read_here
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.parallel.worker_pool import WorkerPool
from flight_file.reader import Flight

# Pictures are decompressed so often, so that there is something to measure.
LOOPS = 4
# What two processes that merely decompress gain by the clock where there are two processors for them.
GIVEN = 1.85
FEW_ROUNDS = 3
# Rounds at most, for each that is wanted.
TRIES = 4


@dataclass(frozen=True, slots=True)
class TwoByOne:
    """Medians of rounds: by the clock, how much sooner two have done what one does.

    Attributes
    ----------
    ours
        Two workers that read, beside one process that reads.
    bare
        Two processes that merely decompress, beside one.
    rounds, all_rounds
        Those that count, in which the machine gave two processors; if there were fewer than three, all count.
    """

    ours: float
    bare: float
    rounds: int
    all_rounds: int


def two_by_one(flight: Flight, source: PanelPictures, size: Size) -> TwoByOne:
    """Measured in rounds until enough of them count, or the machine does not give two processors often enough."""
    reader = reader_from_panel(source, Method.NORMXCORR)
    measured: list[tuple[float, float]] = []
    with decompressing(flight.paths[0], PICTURES, PICTURES * LOOPS) as bare_by_one, WorkerPool(2) as pool:
        for read in (read_here, pool.read):  # so that each has its memory
            _took_s(read, reader, flight)
        while len(measured) < TRIES * size.rounds and len(_given(measured)) < size.rounds:
            one_s = _took_s(read_here, reader, flight)
            before, two_s, after = bare_by_one(), _took_s(pool.read, reader, flight), bare_by_one()
            measured.append((one_s / two_s, min(before, after)))
    given = _given(measured)
    counted = given if len(given) >= FEW_ROUNDS else measured
    ours, bare = (statistics.median(numbers) for numbers in zip(*counted, strict=True))
    return TwoByOne(ours, bare, len(counted), len(measured))


def _given(measured: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(ours, bare) for ours, bare in measured if bare >= GIVEN]


def _took_s(read: ReadBatches, reader: PanelReader, flight: Flight) -> float:
    """By the clock, until the flight is read."""
    height, width = reader.source.picture.shape
    start = time.perf_counter()
    for _ in read(reader, batches(flight.frames(), batch_frames((width, height)))):
        pass
    return time.perf_counter() - start
