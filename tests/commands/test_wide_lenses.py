"""A flight that a wide lens took, the panel far off its axis, is read as through a pinhole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from decoder.imaging.pictures import grey_picture
from decoder.imaging.video import encoded_of
from decoder.timeseries.tables import read_table
from flight_file.reader import open_flight
from tests.commands.conftest import Decoded
from tests.programs import FIXTURES, MakeFlight, write_yaml, yaml_of

Points = NDArray[np.float64]
TAKEN = FIXTURES / "oblique"
OWN = np.array([[1492.934, 0, 403.5], [0, 1492.934, 302.5], [0, 0, 1]])  # of the pinhole that took it
SIZE_PX, SCALE = (1616, 1212), 1100.0
WIDE = np.array([[SCALE, 0, 807.5], [0, SCALE, 605.5], [0, 0, 1]])
ASIDE = cv2.Rodrigues(np.array([0.0, 0.42, 0.0]))[0]  # 24 degrees to the side: the panel's far edge is 38 off the axis


@dataclass(frozen=True)
class WideLens:
    """A lens by OpenCV's functions, to bend pictures that a pinhole took; nothing of ours is used."""

    coefficients: dict[str, float]
    bend: Callable[[Any, Any], object]
    straighten: Callable[[Any, Any], object]

    @cached_property
    def values(self) -> Points:
        """In OpenCV's order."""
        return np.array([*self.coefficients.values()])

    def points(self, pixels: object) -> Points:
        """(N, 2): where it shows what the pinhole showed at (N, 2) pixels."""
        plain = np.asarray(pixels, np.float64).reshape(-1, 2)
        sights = np.column_stack([plain, np.ones(len(plain))]) @ np.linalg.inv(OWN).T @ ASIDE.T
        return np.asarray(self.bend((sights[:, :2] / sights[:, 2:])[:, None], self.values), np.float64).reshape(-1, 2)

    @cached_property
    def maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """For `cv2.remap`: the pinhole's pixel of each of its pixels."""
        x, y = np.meshgrid(np.arange(SIZE_PX[0], dtype=np.float64), np.arange(SIZE_PX[1], dtype=np.float64))
        tangents = np.asarray(self.straighten(np.stack([x.ravel(), y.ravel()], axis=1)[:, None], self.values))
        sights = np.column_stack([tangents.reshape(-1, 2), np.ones(x.size)]) @ ASIDE @ OWN.T
        with np.errstate(all="ignore"):
            there = np.where(sights[:, 2:] > 0, sights[:, :2] / sights[:, 2:], -1.0).astype(np.float32)
        return there[:, 0].reshape(x.shape), there[:, 1].reshape(x.shape)

    def jpeg(self, grey: NDArray[np.uint8]) -> bytes:
        """Its picture of what the pinhole took."""
        bent = cv2.remap(grey, *self.maps, cv2.INTER_CUBIC)
        return cv2.imencode(".jpg", bent, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes()


LENSES = {
    "fisheye": WideLens(
        {"k1": 0.06, "k2": -0.02, "k3": 0.01, "k4": -0.002},
        lambda sights, bend: cv2.fisheye.distortPoints(sights, WIDE, bend),
        lambda seen, bend: cv2.fisheye.undistortPoints(seen, WIDE, bend),
    ),
    "rational": WideLens(
        {"k1": 0.4, "k2": 0.05, "p1": 0.0, "p2": 0.0, "k3": 0.002, "k4": 0.8, "k5": 0.1, "k6": 0.01},
        lambda sights, bend: cv2.projectPoints(
            cv2.convertPointsToHomogeneous(sights), np.zeros(3), np.zeros(3), WIDE, bend
        )[0],
        lambda seen, bend: cv2.undistortPoints(seen, WIDE, bend, criteria=(3, 100, 1e-10)),
    ),
}

EVERY = 4


@pytest.mark.slow
@pytest.mark.untraced
@pytest.mark.parametrize("model", LENSES)
def test_a_flight_through_a_wide_lens_is_read(
    model: str, decode: Callable[..., Decoded], make_flight: MakeFlight, tmp_path: Path
) -> None:
    """Within 0.35 % of full scale on average, and no value that is called read is off by 2 %."""
    lens, panel = LENSES[model], tmp_path / "panel.yaml"
    content = yaml_of(TAKEN / "t1a_small" / "panel.yaml")
    panel.write_text(yaml.safe_dump(bent_panel(content, lens)), encoding="utf-8")
    picture = grey_picture((TAKEN / "t1a_small" / "panel.jpg").read_bytes())
    (tmp_path / "panel.jpg").write_bytes(lens.jpeg(picture))
    camera = tmp_path / "camera.yaml"
    entry = {"focal_length_mm": 3.0, "model": model, **lens.coefficients}
    focal = {"pixels_per_radian": [SCALE, 0, 0], "range_mm": [3.0, 3.0]}
    write_yaml(camera, {"picture_size": [*SIZE_PX], "focal": focal, "distortion": [entry]})
    frames = [grey_picture(encoded_of(frame)) for frame in open_flight([TAKEN / "t1a_small.mcap"]).frames()][::EVERY]

    flight = make_flight([lens.jpeg(frame) for frame in frames], panel=panel)
    rows = decode(flight, "--camera", camera, "--jobs", 2).rows

    truth = read_table(TAKEN / "t1a_small_truth.csv")
    for gauge in content["gauges"]:
        full_scale = gauge["scale"][-1][1] - gauge["scale"][0][1]
        for name in (needle["name"] for needle in gauge["needles"]):
            seen = np.array([row[f"{name}_status"] in {"read", "edge"} for row in rows])
            value = np.array([float(row[name] or "nan") for row in rows])
            error = np.abs(value - truth.numbers(name)[::EVERY])[seen] / full_scale
            assert seen.sum() > len(rows) / 2, name
            assert error.mean() < 0.0035, name
            assert error.max() < 0.02, name


def bent_panel(content: dict[str, Any], lens: WideLens) -> dict[str, Any]:
    """A panel for a wide lens: every place carried over, dials as large as they are there."""

    def point(at: list[float]) -> list[float]:
        x, y = lens.points(at)[0].tolist()
        return [x, y]

    def grown(at: list[float]) -> float:
        here, right, below = lens.points([at, [at[0] + 1, at[1]], [at[0], at[1] + 1]])
        return float(np.sqrt(abs(np.linalg.det([right - here, below - here]))))

    def box(x: float, y: float, width: float, height: float) -> list[int]:
        corners = lens.points([[x, y], [x + width, y], [x, y + height], [x + width, y + height]])
        low, high = corners.min(axis=0).round(), corners.max(axis=0).round()
        return [*map(int, low), *map(int, high - low)]

    gauges = [
        gauge | {"centre": point(gauge["centre"]), "radius": [r * grown(gauge["centre"]) for r in gauge["radius"]]}
        for gauge in content["gauges"]
    ]
    return {
        "name": content["name"], "picture": content["picture"], "gauges": gauges,
        "reference_points": [{**known, "at": point(known["at"])} for known in content["reference_points"]],
        "level": [point(end) for end in content["level"]],
        "anchors": [{**anchor, "box": box(*anchor["box"])} for anchor in content["anchors"]],
    }  # fmt: skip
