"""`python -m benchmarks.whole_panel`: everything that a pilot reads on one panel, and what reading it costs.

The simulator's flight in `../shared`, clean and through a bad lens, with one panel that describes all its instruments:
dials, cards, a horizon, a ball, lamps, displays, straight scales and a compass.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import simplejpeg
from threadpoolctl import threadpool_limits

from benchmarks.real_pictures import PANELS, STOPS, Read, Source, decode_source, reads
from decoder.imaging.panel_pictures import panel_from_file
from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.outputs.csv_output import text_table
from decoder.panel.vocabulary import Method
from flight_file.reader import spread

PANEL = PANELS / "flight_a_whole.yaml"
RENAMED = {
    "clock_s": "clock_local_s",
    "adf_bearing_deg": "adf_needle_deg",  # its card stands still in this flight
    "low_voltage_on": "low_voltage_led",
    "adf_stby_khz": "adf_right_display",
    "dme_nmi": "txt_dme_miles",
    "dme_kt": "txt_dme_right",
}
SOURCES = tuple(
    Source(
        f"simulator's whole panel, {words}",
        f"cockpit_flight/{flight}/*.jpg",
        PANEL,
        "cockpit_flight/flight_a_panel.jpg",
        f"cockpit_flight/{flight}_truth.csv",
        renamed=RENAMED,
        stops=STOPS,
    )
    for flight, words in (("flight_a", "oblique"), ("flight_a_real", "bad lens"))
)
BATCH, FRAMES, ROUNDS = 40, 80, 5


def main() -> None:
    """Print a table for each flight, and the cost."""
    if not any(SOURCES[0].folder.glob(SOURCES[0].pictures)):
        sys.exit("the simulator's pictures are not there")
    cv2.setNumThreads(1)  # as `decode` does
    for source in SOURCES:
        with TemporaryDirectory() as name:
            decoded = decode_source(source, Path(name))
            print(f"{source.title}\n\n{text_table(HEADER, [_row(read) for read in reads(decoded)])}\n")
            if source is SOURCES[0]:
                print(_cost(decoded.panel, decoded.pictures), "\n")


HEADER = ("column", "valued", "read", "mean %FS", "worst %FS", "gross", "inside 95 %")


COST_LEGEND = """\
A simulator's cockpit of 1600 x 1200 with all that a pilot reads on it: dials, cards under needles, a horizon, a ball, a
compass, displays, a lamp and straight scales; in one process that has its memory.
"""


def cost_section() -> str:
    """Say what reading the whole panel costs, as a section of a page; nothing where its pictures are not there."""
    if not any(SOURCES[0].folder.glob(SOURCES[0].pictures)):
        return ""
    with TemporaryDirectory() as name:
        decoded = decode_source(SOURCES[0], Path(name))
        return f"## Everything on one panel\n\n{COST_LEGEND}\n{_cost(decoded.panel, decoded.pictures)}.\n\n"


def _row(read: Read) -> tuple[str, ...]:
    shares = (f"{read.valued:.1%}", f"{read.read:.1%}")
    return (read.needle, *shares, f"{read.mean:.3f}", f"{read.largest:.3f}", str(read.gross), f"{read.within_95:.1%}")


def _cost(panel: Path, pictures: list[Path]) -> str:
    """Say what reading costs beside decompressing in grey, in one process, once its memory is there."""
    encoded = [path.read_bytes() for path in pictures]
    with threadpool_limits(1):
        reader = _fitted(panel, encoded)
        frames = [FramePicture(_grey(each), None) for each in encoded[:FRAMES]]

        def read() -> None:
            for first in range(0, FRAMES, BATCH):
                reader.read(frames[first : first + BATCH])

        def decompress() -> None:
            for each in encoded[:FRAMES]:
                _grey(each)

        read()
        ratios = [1.0 + _seconds(read) / _seconds(decompress) for _ in range(ROUNDS)]
    columns = len(reader.source.panel.quantities)
    return f"{columns} columns: {statistics.median(ratios):.2f} times bare decompression in grey"


def _fitted(panel: Path, encoded: list[bytes]) -> PanelReader:
    source = panel_from_file(panel)
    return fit_to_flight(
        reader_from_panel(source, Method.NORMXCORR),
        lambda count: (FramePicture(_grey(encoded[place]), None) for place in sorted(spread(len(encoded), count))),
    ).reader


def _grey(encoded: bytes) -> GreyPicture:
    picture: GreyPicture = simplejpeg.decode_jpeg(encoded, "GRAY")[:, :, 0]
    return picture


def _seconds(work: Callable[[], None]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


if __name__ == "__main__":
    main()
