"""`python -m benchmarks.film`: how fast a film of a whole panel is read, beside decoding it alone.

The film is the simulator's flight, 1600 x 1200 pixels, filmed at 30 frames a second, one picture a frame, forth and
back so that neighbours are alike: nearly the pixels of 1080p30, and all of the panel's instruments.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import av
from av.video.stream import VideoStream

from benchmarks.real_pictures import Source, available
from decoder.imaging.panel_pictures import panel_from_file
from decoder.imaging.picture_block import batch_frames
from decoder.imaging.pictures import colour_picture, grey_picture
from decoder.imaging.video import GroupDecoder, encoded_of
from decoder.instruments.frame_batch import ReadBatches, batches, read_here
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.learning.flight_sample import FlightSample
from decoder.outputs.csv_output import text_table
from decoder.panel.vocabulary import Method
from decoder.parallel.worker_pool import WorkerPool
from flight_file.reader import Flight, open_flight
from tests.programs import ran

TITLE = "simulator flight, oblique"
RATE_HZ = 30
GROUP = 30
PASSES = 2
ROUNDS = 3
SETTINGS = {"crf": "23", "preset": "veryfast"}


def main() -> None:
    """Measure, and print a table."""
    source = next((each for each in available() if each.title == TITLE), None)
    if source is None:
        sys.exit("the simulator's pictures are not there")
    with TemporaryDirectory() as name:
        flight = _filmed(source, Path(name))
        reader = reader_from_panel(panel_from_file(source.panel), Method.NORMXCORR)
        fitted = fit_to_flight(reader, FlightSample(flight, reader.placer.rows_at_first())).reader
        print(text_table(["", "value"], list(_rows(fitted, flight))))


def _filmed(source: Source, folder: Path) -> Flight:
    """Film a source's pictures and record the film."""
    film, recorded = folder / "film.mp4", folder / "film.mcap"
    pictures = [colour_picture(path.read_bytes()) for path in sorted(source.folder.glob(source.pictures))]
    once = [*pictures, *pictures[-2:0:-1]]
    with av.open(str(film), "w") as container:
        stream = container.add_stream("libx264", rate=RATE_HZ, options=SETTINGS)
        if not isinstance(stream, VideoStream):
            raise TypeError(stream)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt, stream.codec_context.gop_size = "yuv420p", GROUP
        stream.time_base = Fraction(1, RATE_HZ)
        for picture in chain.from_iterable([once] * PASSES):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
        container.mux(stream.encode(None))
    done = ran("recorder", "replay", film, "-o", recorded)
    if done.returncode:
        sys.exit(done.stderr)
    return open_flight([recorded])


def _rows(reader: PanelReader, flight: Flight) -> Iterator[list[str]]:
    frames = flight.count()
    bare_s, read_s, clock_s = [], [], []
    with WorkerPool(2) as pool:
        _read(pool.read, reader, flight)  # so that each process has its memory
        _read(read_here, reader, flight)
        for _ in range(ROUNDS):
            bare_s.append(_took_s(time.process_time, lambda: _decode(flight)))
            read_s.append(_took_s(time.process_time, lambda: _read(read_here, reader, flight)))
            clock_s.append(_took_s(time.perf_counter, lambda: _read(pool.read, reader, flight)))
    bare, read, clock = (statistics.median(each) / frames for each in (bare_s, read_s, clock_s))
    ratio = statistics.median(one / other for one, other in zip(read_s, bare_s, strict=True))
    yield ["frames", str(frames)]
    yield ["columns", str(len(reader.source.panel.quantities))]
    yield ["decoding alone, ms of processor time a frame", f"{1e3 * bare:.1f}"]
    yield ["reading, ms of processor time a frame", f"{1e3 * read:.1f}"]
    yield ["reading, times decoding alone", f"{ratio:.2f}"]
    yield ["two workers, ms by the clock a frame", f"{1e3 * clock:.1f}"]
    yield ["two workers, times as fast as filmed", f"{1 / RATE_HZ / clock:.2f}"]


def _took_s(clock: Callable[[], float], work: Callable[[], None]) -> float:
    start = clock()
    work()
    return clock() - start


def _decode(flight: Flight) -> None:
    video = GroupDecoder()
    for frame in flight.shown():
        grey_picture(encoded_of(frame), video)


def _read(read: ReadBatches, reader: PanelReader, flight: Flight) -> None:
    height, width = reader.source.picture.shape
    for _ in read(reader, batches(flight.shown(), batch_frames((width, height)))):
        pass


if __name__ == "__main__":
    main()
