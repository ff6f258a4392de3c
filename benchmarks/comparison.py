"""What reading a frame costs in several ways, each as a ratio to merely decompressing it in the same round."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
from threadpoolctl import threadpool_limits

from benchmarks.angauge import values_by_needle
from benchmarks.plain_way import Correlate, PlainWay, with_opencv, with_skimage
from benchmarks.sized_flights import PICTURES, SIZES, Size, sized_flight
from benchmarks.two_workers import LOOPS, TwoByOne, two_by_one
from decoder.imaging.panel_pictures import PanelPictures, panel_from_attachments
from decoder.imaging.pictures import grey_picture
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.timeseries.flight_decoder import decode_flight
from flight_file.reader import Flight

NEEDLES = (7, 24)


@dataclass(frozen=True, slots=True)
class Compared:
    """Processor milliseconds a frame (medians of rounds), and medians of the rounds' ratios to decompression."""

    size: Size
    needles: int
    decompress_ms: float
    ratios: dict[str, float]
    two_by_one: TwoByOne


def compare(sizes: Sequence[Size] = SIZES) -> list[Compared]:
    """All ways at all sizes and numbers of needles, one thread each."""
    cv2.setNumThreads(1)
    with threadpool_limits(1), TemporaryDirectory() as folder:
        return [_compared(Path(folder), size, needles) for size in sizes for needles in NEEDLES]


def _compared(folder: Path, size: Size, needles: int) -> Compared:
    flight = sized_flight(folder, size, needles)
    source = panel_from_attachments(flight.attachments, flight=size.name)
    few = [frame.encoded for frame in islice(flight.frames(), size.slow_frames)]
    ways: dict[str, tuple[int, Callable[[], object]]] = {
        "decode": (size.frames, lambda: decode_flight(flight, reader_from_panel(source, Method.NORMXCORR), iter)),
        "matchTemplate": (size.slow_frames, lambda: _plainly(source, few, with_opencv)),
        "match_template": (size.slow_frames, lambda: _plainly(source, few, with_skimage)),
        "ppf.angauge": (size.slow_frames, lambda: values_by_needle(source, few)),
    }
    bare: list[float] = []
    ratios: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(size.rounds):
        bare.append(_decompressed_ms(flight))
        for name, (frames, way) in ways.items():
            ratios[name].append(1000 * _processor_s(way) / frames / bare[-1])
    return Compared(
        size=size,
        needles=needles,
        decompress_ms=statistics.median(bare),
        ratios={name: statistics.median(own) for name, own in ratios.items()},
        two_by_one=two_by_one(flight, source, size),
    )


def _plainly(source: PanelPictures, jpegs: Sequence[bytes], correlate: Correlate) -> None:
    way = PlainWay(source, correlate)
    for jpeg in jpegs:
        way.read(jpeg)


def _decompressed_ms(flight: Flight) -> float:
    """Milliseconds for a frame, merely decompressed."""
    jpegs = [frame.encoded for frame in islice(flight.frames(), PICTURES)] * LOOPS
    return 1000 * _processor_s(lambda: [grey_picture(jpeg).size for jpeg in jpegs]) / len(jpegs)


def _processor_s(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start
