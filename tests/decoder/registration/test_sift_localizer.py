"""First localization: the panel is found from elsewhere, at another scale and roll, and not where it is absent."""

from __future__ import annotations

import json
from typing import Any

import cv2
import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.panel.panel import parse_panel
from decoder.registration.aligner import Aligner
from decoder.registration.sift_localizer import SiftLocalizer
from tests.decoder.registration.plane import SIZE_PX, boxes, turn

WIDTH_PX, HEIGHT_PX = SIZE_PX


@pytest.fixture(scope="module")
def panel() -> GreyPicture:
    """A picture full of corners."""
    return boxes()


def seen(panel: GreyPicture, motion: np.ndarray, seed: int) -> GreyPicture:
    """A noisy frame, part of it covered."""
    frame = cv2.warpPerspective(panel, motion, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_AREA).astype(float)
    frame[300:420, 100:240] = 15
    frame += np.random.default_rng(seed).normal(0, 3, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


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


@pytest.mark.parametrize(("scale", "roll_deg", "tilt"), [(0.7, 35.0, 0.0), (0.8, -30.0, -0.1), (1.2, 45.0, 0.1)])
def test_frame_far_from_all_others_is_aligned(
    panel: GreyPicture, document: dict[str, Any], scale: float, roll_deg: float, tilt: float
) -> None:
    """A camera rolled by hand loses no frame: the panel is located with SIFT before it is given up."""
    boxes = [(220, 140), (400, 150), (230, 300), (400, 310)]
    anchors = [{"name": f"anchor {number}", "box": [*box, 40, 40]} for number, box in enumerate(boxes)]
    described = parse_panel(json.dumps({**document, "anchors": anchors, "level": None}))
    motion = turn(scale=scale, roll_deg=roll_deg, tilt=(tilt, 0.0), shift_px=(9.0, -14.0))
    found = Aligner(described, panel).align(seen(panel, motion, 4))

    for x, y in boxes:
        there = motion @ (x, y, 1.0)
        assert found.to_frame((x, y)) == pytest.approx(there[:2] / there[2], abs=0.5)
