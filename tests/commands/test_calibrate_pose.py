"""`decode calibrate pose`: where the camera was, the picture squared up, and what users get wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from fixtures.calibration.views import projected
from tests.programs import ran, says

SIZE = (1616, 1212)
POINTS = np.array([[-4.0, -3.0], [4.0, -3.0], [-4.0, 3.5], [4.0, 3.5]])
TURN = np.asarray(cv2.Rodrigues(np.array([0.3, -0.35, 0.06]))[0], np.float64)
SHIFT = np.array([0.4, -0.3, 16.0])
CAMERA = (
    "picture_size: [1616, 1212]\nfocal: {pixels_per_radian: [0, 382.0224719, 0], range_mm: [4, 45]}\n"  # 1700 at 4.45
)


def seen(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) pixels of (N, 2) inches."""
    return projected(TURN, SHIFT, np.pad(points, ((0, 0), (0, 1))))


@pytest.fixture
def cockpit(tmp_path: Path) -> Callable[..., Path]:
    """A panel of bright dots at half inches, drawn as an oblique camera sees it, and its camera."""
    picture = np.full((SIZE[1], SIZE[0]), 40, np.uint8)
    dots = np.stack(np.meshgrid(np.arange(-4, 4.1, 0.5), np.arange(-3, 3.6, 0.5)), axis=-1).reshape(-1, 2)
    for x, y in seen(dots):
        cv2.circle(picture, (round(x * 16), round(y * 16)), 5 * 16, (220,), -1, cv2.LINE_AA, 4)
    cv2.imwrite(str(tmp_path / "panel.png"), picture)
    (tmp_path / "camera.yaml").write_text(CAMERA, encoding="utf-8")

    def write(points: np.ndarray = POINTS, **changes: Any) -> Path:  # noqa: ANN401 - any value of a panel
        needle = {"name": "speed_kt", "template": {"at": 200.0, "span": 18}}
        gauge = {"name": "speed", "centre": [800, 600], "radius": [20, 50], "sweep": [120, 420]}
        panel: dict[str, Any] = {
            "name": "dots",
            "picture": "panel.png",
            "focal_length_mm": 4.45,
            "level": seen(np.array([[1.0, -2.0], [1.0, 3.0]])).tolist(),
            "reference_points": [
                {"at": at, "inches": inches} for at, inches in zip(seen(points).tolist(), points.tolist(), strict=True)
            ],
            "anchors": [{"name": "dot", "box": [780, 580, 40, 40]}],
            "gauges": [{**gauge, "scale": [[120, 0], [420, 100]], "needles": [needle]}],
        }
        path = tmp_path / "panel.yaml"
        path.write_text(yaml.safe_dump({k: v for k, v in (panel | changes).items() if v is not None}), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("count", [3, 4])
def test_the_camera_is_found(cockpit: Callable[..., Path], tmp_path: Path, count: int) -> None:
    """Three points give several solutions of which `level` chooses the right one; four give one."""
    done = ran("decode", "calibrate", "pose", cockpit(POINTS[:count]), "--camera", tmp_path / "camera.yaml", "--json")
    assert done.returncode == 0, done.stderr
    solutions = json.loads(done.stdout)["solutions"]
    true = -TURN.T @ SHIFT
    best = solutions[0]

    assert ("camera positions fit" in done.stderr) == (count == 3) == (len(solutions) > 1)
    assert [best["x_inches"], best["y_inches"], best["distance_inches"]] == pytest.approx(
        [*true[:2], -true[2]], abs=1e-3
    )
    assert best["residual_inches"] < 1e-6
    assert best["y"] == "down"


def test_the_picture_is_squared_up(cockpit: Callable[..., Path], tmp_path: Path) -> None:
    """The dots of the panel stand in a square grid, and what should be level and plumb is, to a tenth of a degree."""
    squared = tmp_path / "squared.png"
    done = ran(
        "decode", "calibrate", "pose", cockpit(), "--camera", tmp_path / "camera.yaml", "--squared", squared, "--json"
    )
    lines = json.loads(done.stdout)["lines"]
    picture = cv2.imread(str(squared), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    count, _, _, centres = cv2.connectedComponentsWithStats((picture > 130).astype(np.uint8))
    dots = centres[1:count]
    apart = np.linalg.norm(dots[:, None] - dots[None], axis=2) + 1e9 * np.eye(len(dots))
    nearest = dots[np.argmin(apart, axis=1)] - dots

    assert max(abs(line["before_deg"]) for line in lines) > 3
    assert max(abs(line["after_deg"]) for line in lines) < 0.01
    assert len(dots) == 17 * 14
    assert apart.min(axis=1).std() / apart.min(axis=1).mean() < 0.01
    assert np.abs(nearest).min(axis=1).max() < 0.01 * apart.min()


LINE = [
    {"at": at, "inches": [x, -3.0]}
    for x, at in zip((-4, 0, 4), seen(np.array([[-4, -3], [0, -3], [4, -3.0]])).tolist(), strict=True)
]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reference_points": LINE}, ["on one line", "triangle"]),
        ({"reference_points": None}, ["three reference points, here are 0"]),
        ({"focal_length_mm": 60.0}, ["covers 4 to 45 mm", "at 60 mm"]),
        ({"focal_length_mm": None}, ["focal_length_mm: is missing"]),
    ],
)
def test_what_tells_no_pose(
    cockpit: Callable[..., Path], tmp_path: Path, changes: dict[str, object], words: list[str]
) -> None:
    """Points on one line, none, a focal length outside the calibration, or none."""
    says(ran("decode", "calibrate", "pose", cockpit(**changes), "--camera", tmp_path / "camera.yaml"), *words)


def test_a_wrong_point_is_named(cockpit: Callable[..., Path], tmp_path: Path) -> None:
    """More points than are needed show which one is off."""
    points = np.vstack([POINTS, [[0.0, 0.5], [2.0, 2.0], [-2.0, 1.0]]])
    places = [{"at": at, "inches": inches} for at, inches in zip(seen(points).tolist(), points.tolist(), strict=True)]
    places[5]["at"][0] += 60
    done = ran("decode", "calibrate", "pose", cockpit(reference_points=places), "--camera", tmp_path / "camera.yaml")

    assert done.returncode == 0
    assert "most of all reference_points[5]; check" in done.stderr


@pytest.mark.parametrize(
    ("name", "code", "says"), [("panel.png", 1, "panel.png: would be overwritten"), ("a.tiff", 2, ".png or .jpg")]
)
def test_picture_squared_up_has_a_name_of_its_own(
    cockpit: Callable[..., Path], tmp_path: Path, name: str, code: int, says: str
) -> None:
    """What is read is never written over, and the ending tells the format."""
    panel = cockpit()
    before = (tmp_path / "panel.png").read_bytes()
    words = (panel, "--camera", tmp_path / "camera.yaml", "--squared", tmp_path / name)
    done = ran("decode", "calibrate", "pose", *words)

    assert done.returncode == code
    assert says in done.stderr
    assert (tmp_path / "panel.png").read_bytes() == before
