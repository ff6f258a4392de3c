"""`recorder` as its users run it: a recorded flight played back, and what they get wrong."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

FIXTURES = Path(__file__).parents[2] / "fixtures"
A1 = FIXTURES / "thesis_a1.mcap"
Run = Callable[..., subprocess.CompletedProcess[str]]


def write_config(folder: Path, *, camera: str) -> Path:
    """A configuration that records into the folder `flights` beside it."""
    config = folder / "recorder.yaml"
    config.write_text(f"camera: {camera}\nstorage: {{directory: flights, keep_free_gib: 0}}\n", encoding="utf-8")
    return config


def test_flight_is_played_back_whole(run: Run, tmp_path: Path) -> None:
    """A replayed flight has the frames of the one it came from, and `recorder info` finds nothing lost."""
    config = write_config(tmp_path, camera=f"{{driver: replay, path: {A1}, pace: fastest}}")
    recorded = run("recorder", "run", "--config", config)
    (flight,) = recorded.stdout.split()
    info = run("recorder", "info", flight, "--json")

    assert (recorded.returncode, info.returncode) == (0, 0)
    assert json.loads(info.stdout)["frames"] == 20


def test_cut_flight_is_done_with_loss(run: Run, tmp_path: Path) -> None:
    """`recorder info` tells a flight that breaks off by its exit code 3."""
    (tmp_path / "cut.mcap").write_bytes(A1.read_bytes()[:1_200_000])

    assert run("recorder", "info", tmp_path / "cut.mcap").returncode == 3


def test_no_such_flight(run: Run, tmp_path: Path) -> None:
    """A flight that is not there is named in one sentence, with exit code 1."""
    done = run("recorder", "info", tmp_path / "no.mcap")

    assert done.returncode == 1
    assert "no.mcap" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_wrong_configuration(run: Run, tmp_path: Path) -> None:
    """An unknown camera is named by its place in the file, with exit code 78; nothing is recorded."""
    done = run("recorder", "run", "--config", write_config(tmp_path, camera="{driver: cine}"))

    assert done.returncode == 78
    assert "camera" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "flights").exists()


def test_wrong_usage(run: Run) -> None:
    """A run without a configuration ends with 2."""
    assert run("recorder", "run").returncode == 2
