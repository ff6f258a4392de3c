"""`decode calibrate distortion`: the block-march test on rendered rulers, and what users get wrong."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from decoder.camera import camera_from_file
from fixtures.calibration.ruler import Scene, photograph

Run = Callable[..., subprocess.CompletedProcess[str]]
CAMERA = (
    "picture_size: [1616, 1212]\nfocal: {pixels_per_radian: [0, 263.8202247, 0], range_mm: [4, 45]}\n"  # 1174 at 4.45
)
LINE = ("--line", "40,599,1570,612", "--inches", "17")


def wide(k1: float, tilt_deg: float = 2.0) -> Scene:
    """A ruler from edge to edge, near the camera, and not quite square on."""
    return Scene(1174.0, distance_inches=13, k1=k1, place_mm=(220, 1.5), turn_deg=0.5, tilt_deg=tilt_deg, seed=1)


@pytest.fixture
def shoot(tmp_path: Path) -> Callable[[Scene], Path]:
    """A photograph of a scene, and a camera.yaml beside it."""

    def write(scene: Scene) -> Path:
        path = tmp_path / "wide.jpg"
        path.write_bytes(photograph(scene, 4.45))
        (tmp_path / "camera.yaml").write_text(CAMERA, encoding="utf-8")
        return path

    return write


def says(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """A program failed with exit code 1 and one sentence that holds all the words."""
    assert done.returncode == 1, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [word for word in words if word not in done.stderr] == []


@pytest.mark.parametrize("k1", [-0.08, 0.02])
def test_a_bending_lens_is_found_and_measured(
    run: Run, shoot: Callable[[Scene], Path], tmp_path: Path, k1: float
) -> None:
    """k1 to a percent, though the ruler is tilted; it takes its place in camera.yaml."""
    file, stacked = tmp_path / "camera.yaml", tmp_path / "stacked.png"
    done = run("decode", "calibrate", "distortion", shoot(wide(k1)), *LINE, "-o", file, "--stacked", stacked, "--json")
    found = json.loads(done.stdout)
    (entry,) = camera_from_file(file).distortion
    bends = np.array([tick["bend_px"] for tick in found["ticks"]])
    picture = cv2.imread(str(stacked), cv2.IMREAD_GRAYSCALE)

    assert not found["negligible"]
    assert entry.k1 == pytest.approx(k1, rel=0.01)
    assert np.sign(bends[[0, -1]]) == pytest.approx(np.sign([k1, k1]))
    assert picture is not None
    assert picture.shape[0] == len(bends) * (picture.shape[0] // len(bends))


@pytest.mark.parametrize("tilt_deg", [0.0, 3.0])
def test_a_straight_lens_is_called_straight(
    run: Run, shoot: Callable[[Scene], Path], tmp_path: Path, tilt_deg: float
) -> None:
    """Whatever the ruler's tilt; camera.yaml stays as it was."""
    photo = shoot(wide(0.0, tilt_deg))
    done = run("decode", "calibrate", "distortion", photo, *LINE, "-o", tmp_path / "camera.yaml")

    assert done.returncode == 0, done.stderr
    assert "distortion is negligible" in done.stdout
    assert (tmp_path / "camera.yaml").read_text(encoding="utf-8") == CAMERA


def test_without_a_camera_file_the_verdict_is_given_all_the_same(
    run: Run, shoot: Callable[[Scene], Path], tmp_path: Path
) -> None:
    """With what to do for a k1."""
    done = run("decode", "calibrate", "distortion", shoot(wide(-0.08)), *LINE, "-o", tmp_path / "other.yaml")

    assert done.returncode == 0
    assert "barrel distortion" in done.stdout
    assert "run `decode calibrate focal` first" in done.stderr


def test_a_ruler_that_is_short_or_misses_the_middle(run: Run, shoot: Callable[[Scene], Path]) -> None:
    """Each in one sentence."""
    photo = shoot(wide(0.0))

    says(
        run("decode", "calibrate", "distortion", photo, "--line", "600,604,1000,607", "--inches", "4.4"),
        "covers 2",
        "cover all",
    )
    says(
        run("decode", "calibrate", "distortion", photo, "--line", "40,300,1570,300", "--inches", "17"),
        "misses the middle",
    )
