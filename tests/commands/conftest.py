"""The programs as their users run them, and flights to run them on."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml
from PIL import Image, ImageDraw

from decoder.thread_limits import ONE_EACH
from flight_file.reader import open_flight
from recorder.clock import SimulatedClock
from recorder.config import parse_config
from recorder.journal import Journal
from recorder.run import record
from recorder.testing import fixed_host

FIXTURES = Path(__file__).parents[2] / "fixtures"
PROGRAMS = Path(sys.executable).parent
PATIENCE_S = 120

Run = Callable[..., subprocess.CompletedProcess[str]]
MakeFlight = Callable[..., Path]


@dataclass(frozen=True, slots=True)
class Decoded:
    """What `decode` left in a folder."""

    rows: list[dict[str, str]]
    csv_file: Path
    json_file: Path


@pytest.fixture(scope="session")
def decode_server() -> Iterator[subprocess.Popen[str]]:
    """Forks `decode` without loading its libraries anew; see decode_server.py."""
    command = [sys.executable, str(Path(__file__).with_name("decode_server.py"))]
    # A thread pool that a fork leaves behind must never have been made.
    environment = {**os.environ, **ONE_EACH}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as server:
        yield server
        server.communicate(timeout=PATIENCE_S)


@pytest.fixture
def run(decode_server: subprocess.Popen[str], tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs a program of ours to its end."""
    printed = tmp_path_factory.mktemp("printed")

    def run_decode(words: Sequence[str]) -> subprocess.CompletedProcess[str]:
        out, err = (printed / name for name in ("out", "err"))
        ask = {"words": words, "place": str(Path.cwd()), "out": str(out), "err": str(err)}
        assert decode_server.stdin is not None
        assert decode_server.stdout is not None
        decode_server.stdin.write(json.dumps(ask) + "\n")
        decode_server.stdin.flush()
        code = int(decode_server.stdout.readline())
        texts = (path.read_text(encoding="utf-8") for path in (out, err))
        return subprocess.CompletedProcess(["decode", *words], code, *texts)

    def run_program(program: str, *words: object) -> subprocess.CompletedProcess[str]:
        if program == "decode":
            return run_decode([*map(str, words)])
        command = [str(PROGRAMS / program), *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)

    return run_program


@pytest.fixture(scope="session")
def pictures() -> list[bytes]:
    """The JPEGs of a committed flight."""
    return [frame.jpeg for frame in open_flight([FIXTURES / "thesis_a1.mcap"]).frames()]


@pytest.fixture
def make_flight(tmp_path: Path) -> MakeFlight:
    """Records JPEGs into a flight file, by default with the animation's panel."""

    def make(jpegs: Iterable[bytes], *, panel: Path | None = FIXTURES / "panel.yaml", name: str = "flight") -> Path:
        camera = tmp_path / f"{name}_camera"
        camera.mkdir()
        for number, jpeg in enumerate(jpegs):
            (camera / f"{number:05d}.jpg").write_bytes(jpeg)
        document = {
            "camera": {"driver": "replay", "path": str(camera), "rate_hz": 4, "pace": "fastest"},
            "storage": {"directory": str(tmp_path / f"{name}_storage"), "segment_s": 3600, "keep_free_gib": 0},
        }
        if panel is not None:
            document["attach"] = {"panel": str(panel)}
        outcome = record(
            parse_config(document), host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()), name=name
        )
        (segment,) = outcome.paths
        target = tmp_path / f"{name}.mcap"
        target.write_bytes(segment.read_bytes())
        return target

    return make


def decoded(folder: Path) -> Decoded:
    """The flight data in a folder that holds one set of them."""
    (csv_file,) = (path for path in folder.glob("*.csv") if not path.stem.endswith("_alignment"))
    with csv_file.open(encoding="utf-8", newline="") as stream:
        return Decoded(list(csv.DictReader(stream)), csv_file, csv_file.with_suffix(".json"))


@pytest.fixture
def read_decoded() -> Callable[[Path], Decoded]:
    """Reads what `decode` left in a folder."""
    return decoded


def without_knob(jpeg: bytes) -> bytes:
    """A frame of the animation with its anchor painted over."""
    picture = Image.open(io.BytesIO(jpeg))
    left, top, width, height = anchor_box()
    ImageDraw.Draw(picture).rectangle([left - 30, top - 30, left + width + 30, top + height + 30], fill=(60, 60, 60))
    painted = io.BytesIO()
    picture.save(painted, "JPEG", quality=90)
    return painted.getvalue()


def anchor_box() -> tuple[int, int, int, int]:
    """The box of the animation panel's only anchor."""
    panel = yaml.safe_load((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))
    left, top, width, height = panel["anchors"][0]["box"]
    return left, top, width, height


@pytest.fixture
def cover_knob() -> Callable[[bytes], bytes]:
    """Paints the anchor over in a frame of the animation."""
    return without_knob
