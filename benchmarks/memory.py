"""Memory: the peak of a decode of 400 and of 4000 frames."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.flights import RENDERED
from benchmarks.programs import peak_memory_mib
from fixtures.animation.camera import FRAME_RATE_HZ
from fixtures.make import FOLDER
from recorder.clock import SimulatedClock
from recorder.config import parse_config
from recorder.journal import Journal
from recorder.run import record
from recorder.testing import fixed_host

LENGTHS = (400, 4000)


@dataclass(frozen=True, slots=True)
class Peak:
    """The most memory that a decode of so many frames held."""

    frames: int
    mib: float


def measure_memory() -> list[Peak]:
    """Decodes the plain flight once, and ten times over as one flight."""
    with TemporaryDirectory() as folder:
        return [_peak(Path(folder) / str(frames), frames) for frames in LENGTHS]


def _peak(folder: Path, frames: int) -> Peak:
    flight = _repeated(folder, frames)
    return Peak(frames, peak_memory_mib(flight, "-o", folder / "decoded"))


def _repeated(folder: Path, frames: int) -> Path:
    """The plain flight's pictures, over and over, recorded by the recorder's replay driver into one flight file."""
    pictures = sorted((RENDERED / "plain").glob("*.jpg"))
    camera = folder / "camera"
    camera.mkdir(parents=True)
    for number in range(frames):
        os.symlink(pictures[number % len(pictures)], camera / f"{number:05d}.jpg")
    config = parse_config(
        {
            "camera": {"driver": "replay", "path": str(camera), "rate_hz": FRAME_RATE_HZ, "pace": "fastest"},
            "storage": {"directory": str(folder / "storage"), "segment_s": 86400, "keep_free_gib": 0},
            "attach": {"panel": str(FOLDER / "panel.yaml")},
        }
    )
    outcome = record(config, host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()), name="repeated")
    (segment,) = outcome.paths
    return segment
