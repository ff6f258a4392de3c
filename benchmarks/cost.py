"""What a decode costs: processor time beside bare decompression in the same run, and peak memory."""

from __future__ import annotations

import io
import os
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
from threadpoolctl import threadpool_limits

from benchmarks.programs import RENDERED, decode, decompress, peak_memory_mib
from decoder.flight_decoder import decode_flight
from decoder.method import Method
from decoder.panel_pictures import panel_from_attachments
from decoder.panel_reader import PanelReader
from decoder.pictures import grey_picture
from flight_file.reader import open_flight
from recorder.clock import SimulatedClock
from recorder.config import parse_config
from recorder.journal import Journal
from recorder.run import record
from recorder.testing import fixed_host

ROUNDS = 7
# A sample spread over so many finds no picture twice, as in a flight that is really so long.
COPIES = 11


@dataclass(frozen=True, slots=True)
class Speed:
    """Medians of several rounds: processor milliseconds a frame, and ratios to decompression in the same round.

    `decompress` and `decode` run in a process that is there already, whose memory has been broken in; `alone` is the
    same decompression by a process that does nothing else, and has the system clear new pages for each picture;
    `program` is `decode` from its start to its written files.
    """

    frames: int
    alone_ms: float
    decompress_ms: float
    decode_ms: float
    program_ms: float
    decode_ratio: float
    program_ratio: float
    decompress_by_alone: float
    decode_by_alone: float
    program_by_alone: float


def speed() -> Speed:
    """Decoding the 400 plain frames beside merely decompressing them in grey, one thread, back to back."""
    cv2.setNumThreads(1)
    alone, bare, whole, program = [], [], [], []
    with threadpool_limits(1), TemporaryDirectory() as folder:
        flight = open_flight([RENDERED / "plain.mcap"])
        jpegs = [frame.jpeg for frame in flight.frames()]
        panel = panel_from_attachments(flight.attachments, flight="plain.mcap")
        for _ in range(ROUNDS):
            alone.append(decompress(RENDERED / "plain.mcap"))
            start = time.process_time()
            for jpeg in jpegs:
                grey_picture(jpeg)
            middle = time.process_time()
            decode_flight(flight, PanelReader.from_panel(panel, Method.NORMXCORR), iter)
            bare.append(middle - start)
            whole.append(time.process_time() - middle)
            program.append(decode(RENDERED / "plain.mcap", Path(folder)))
    per_frame = 1000 / len(jpegs)
    return Speed(
        frames=len(jpegs),
        alone_ms=statistics.median(alone) * per_frame,
        decompress_ms=statistics.median(bare) * per_frame,
        decode_ms=statistics.median(whole) * per_frame,
        program_ms=statistics.median(program) * per_frame,
        decode_ratio=_median_ratio(whole, bare),
        program_ratio=_median_ratio(program, bare),
        decompress_by_alone=_median_ratio(bare, alone),
        decode_by_alone=_median_ratio(whole, alone),
        program_by_alone=_median_ratio(program, alone),
    )


def _median_ratio(costs: Sequence[float], bare: Sequence[float]) -> float:
    return statistics.median(cost / least for cost, least in zip(costs, bare, strict=True))


def memory() -> dict[int, float]:
    """Peak resident memory of `decode` in MiB, by the number of frames: the plain flight, and eleven times that."""
    pictures = sorted((RENDERED / "plain").glob("*.jpg"))
    with TemporaryDirectory() as name:
        folder = Path(name)
        camera = folder / "camera"
        camera.mkdir()
        for number in range(len(pictures) * COPIES):
            os.link(pictures[number % len(pictures)], camera / f"{number:05d}.jpg")
        config = parse_config(
            {
                "camera": {"driver": "replay", "path": str(camera), "rate_hz": 4, "pace": "fastest"},
                "storage": {
                    "directory": str(folder / "long"),
                    "segment_s": 36000,
                    "segment_mib": 4096,
                    "keep_free_gib": 0,
                },
                "attach": {"panel": str(RENDERED.parent / "panel.yaml")},
            }
        )
        outcome = record(config, host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()), name="long")
        (long,) = outcome.paths
        return {
            len(pictures): peak_memory_mib(RENDERED / "plain.mcap", folder / "out"),
            len(pictures) * COPIES: peak_memory_mib(long, folder / "out"),
        }
