"""First sight: the panel is found from elsewhere, at another scale and roll, and nothing is made up where it is not."""

from __future__ import annotations

import json
import math
from typing import Any

import cv2
import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.panel.panel import parse_panel
from decoder.registration.aligner import Aligner
from decoder.registration.sift_localizer import SiftLocalizer

HEIGHT_PX, WIDTH_PX = 480, 640


@pytest.fixture(scope="module")
def panel() -> GreyPicture:
    """A picture full of corners: dark and light boxes in random places."""
    rng = np.random.default_rng(11)
    picture = np.full((HEIGHT_PX, WIDTH_PX), 70, np.uint8)
    for _ in range(260):
        x, y = int(rng.integers(WIDTH_PX)), int(rng.integers(HEIGHT_PX))
        end = (x + int(rng.integers(6, 40)), y + int(rng.integers(6, 40)))
        cv2.rectangle(picture, (x, y), end, int(rng.integers(20, 240)), -1)
    return cv2.GaussianBlur(picture, (0, 0), 0.8).astype(np.uint8)


def view(scale: float, roll_deg: float, tilt: float) -> np.ndarray:
    """(3, 3): the panel picture in a frame of its size, seen smaller or larger, rolled, and from one side."""
    cos, sin = scale * math.cos(math.radians(roll_deg)), scale * math.sin(math.radians(roll_deg))
    x, y = WIDTH_PX / 2, HEIGHT_PX / 2
    back = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1]])
    there = np.array([[1, 0, x + 9], [0, 1, y - 14], [0, 0, 1]])
    return there @ np.array([[cos, -sin, 0], [sin, cos, 0], [tilt, 0, 1]]) @ back


def seen(panel: GreyPicture, motion: np.ndarray, seed: int) -> GreyPicture:
    """A noisy frame, part of it covered."""
    frame = cv2.warpPerspective(panel, motion, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_AREA).astype(float)
    frame[300:420, 100:240] = 15
    frame += np.random.default_rng(seed).normal(0, 3, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("scale", "roll_deg", "tilt"), [(0.7, 3.0, 0.0), (0.89, -6.0, 2e-4), (1.3, 12.0, -2e-4)])
def test_panel_is_found_from_elsewhere(panel: GreyPicture, scale: float, roll_deg: float, tilt: float) -> None:
    """To a pixel or two, which is all that the aligner needs."""
    motion = view(scale, roll_deg, tilt)
    found = SiftLocalizer(panel).find(seen(panel, motion, 3))

    assert found is not None
    points = np.array([[200, 440, 440, 200], [150, 150, 330, 330], [1, 1, 1, 1]], float)
    there, expected = found @ points, motion @ points
    assert np.abs(there[:2] / there[2] - expected[:2] / expected[2]).max() < 1.5


@pytest.mark.parametrize("kind", ["dark", "noise", "another panel"])
def test_no_panel_is_no_panel(panel: GreyPicture, kind: str) -> None:
    """A frame that shows something else gives nothing."""
    rng = np.random.default_rng(5)
    frame = {
        "dark": np.zeros((HEIGHT_PX, WIDTH_PX), np.uint8),
        "noise": rng.integers(0, 255, (HEIGHT_PX, WIDTH_PX)).astype(np.uint8),
        "another panel": np.ascontiguousarray(panel[::-1, ::-1].T),
    }[kind]

    assert SiftLocalizer(np.ascontiguousarray(panel[:240])).find(np.ascontiguousarray(frame[:200, :200])) is None
    assert SiftLocalizer(frame).find(panel) is None or kind == "another panel"


@pytest.mark.parametrize(
    ("scale", "roll_deg", "tilt"), [(0.7, 35.0, 0.0), (0.8, -30.0, 1e-4), (1.2, 45.0, -1e-4), (1.1, 25.0, -1e-4)]
)
def test_frame_far_from_all_others_is_aligned(
    panel: GreyPicture, document: dict[str, Any], scale: float, roll_deg: float, tilt: float
) -> None:
    """A hand that rolls the camera loses no frame: the panel is located before it is given up."""
    boxes = [(220, 140), (400, 150), (230, 300), (400, 310)]
    anchors = [{"name": f"anchor {number}", "box": [*box, 40, 40]} for number, box in enumerate(boxes)]
    described = parse_panel(json.dumps({**document, "anchors": anchors, "level": None}))
    motion = view(scale, roll_deg, tilt)
    found = Aligner(described, panel).align(seen(panel, motion, 4))

    for x, y in boxes:
        there = motion @ (x, y, 1.0)
        assert found.to_frame((x, y)) == pytest.approx(there[:2] / there[2], abs=0.5)
