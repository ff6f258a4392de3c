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
from typing import Self

import cv2
from threadpoolctl import threadpool_limits

from benchmarks.programs import RENDERED, decode, decompressed_alone, peak_memory_mib, read_alone
from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.imaging.pictures import grey_picture
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.timeseries.flight_decoder import decode_flight
from flight_file.reader import open_flight
from recorder.config import parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.run import record

ROUNDS = 7
# A sample spread over so many finds no picture twice, as in a flight that is really so long.
COPIES = 11


@dataclass(frozen=True, slots=True)
class Cost:
    """Medians of several rounds: processor milliseconds a frame, and the ratio to decompression in the same round."""

    ms: float
    ratio: float

    @classmethod
    def of(cls, costs_s: Sequence[float], bare_s: Sequence[float], frames: int) -> Self:
        """From what it took in each round, and what decompression took in the same."""
        ratios = (cost / least for cost, least in zip(costs_s, bare_s, strict=True))
        return cls(1000 * statistics.median(costs_s) / frames, statistics.median(ratios))


@dataclass(frozen=True, slots=True)
class Speed:
    """What 400 frames cost beside merely decompressing them in grey, one thread, back to back.

    Attributes
    ----------
    bare_alone, read_alone
        Decompressed, and read, by a process of its own each, which gets its memory from the system as it goes.
    bare, read
        The same in one process that has done both before: its memory is there.
    program
        `decode` from its start to its written files; the ratio is to `bare`.
    """

    frames: int
    bare_alone: Cost
    read_alone: Cost
    bare: Cost
    read: Cost
    program: Cost


def speed() -> Speed:
    """Of the 400 plain frames."""
    cv2.setNumThreads(1)
    path = RENDERED / "plain.mcap"
    alone_bare, alone_read, bare, read, program = ([] for _ in range(5))
    with threadpool_limits(1), TemporaryDirectory() as folder:
        flight = open_flight([path])
        jpegs = [frame.encoded for frame in flight.frames()]
        panel = panel_from_attachments(flight.attachments, flight=path.name)
        for _ in range(ROUNDS):
            alone_bare.append(decompressed_alone(path))
            alone_read.append(read_alone(path))
            start = time.process_time()
            for jpeg in jpegs:
                grey_picture(jpeg)
            middle = time.process_time()
            decode_flight(flight, reader_from_panel(panel, Method.NORMXCORR), iter)
            bare.append(middle - start)
            read.append(time.process_time() - middle)
            program.append(decode(path, Path(folder)))
    count = len(jpegs)
    return Speed(
        frames=count,
        bare_alone=Cost.of(alone_bare, alone_bare, count),
        read_alone=Cost.of(alone_read, alone_bare, count),
        bare=Cost.of(bare, bare, count),
        read=Cost.of(read, bare, count),
        program=Cost.of(program, bare, count),
    )


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
                    "segment_frames": len(pictures) * COPIES,
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
