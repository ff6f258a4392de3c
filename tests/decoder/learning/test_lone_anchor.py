"""A panel with one anchor and no level edge: the flight shows whether the camera rolls, leans or never moves."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import yaml

from decoder.imaging.motion import carried
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import around_pivots, reader_from_panel
from decoder.learning.flight_sample import align_sample
from decoder.panel.arrays import Floats
from decoder.panel.panel import parse_panel
from decoder.panel.vocabulary import Method
from tests.decoder.registration.plane import GAUGE_PX, SIZE_PX, boxes, document_of, turn

ANCHOR = {"name": "texture", "box": [290, 120, 60, 46]}
RIM = np.array([[GAUGE_PX[0] + x, GAUGE_PX[1] + y] for x, y in ((0, 0), (50, 0), (-50, 0), (0, 50), (0, -50))]).T


def frame(motion: Floats, seed: int) -> GreyPicture:
    """What a camera sees from there, with some noise."""
    seen = cv2.warpPerspective(boxes(), motion, SIZE_PX).astype(float)
    return np.clip(seen + np.random.default_rng(seed).normal(0, 2, seen.shape), 0, 255).astype(np.uint8)


def aligned(motions: list[Floats]) -> tuple[PanelReader, float]:
    """The reader after aligning a flight's frames, and the largest error of the gauge's rim in any of them, px."""
    document = {**document_of(()), "anchors": [ANCHOR]}
    source = PanelPictures(parse_panel(yaml.safe_dump(document)), {"panel.png": boxes()}, "0" * 64)
    frames = [frame(motion, seed) for seed, motion in enumerate(motions)]
    reader, samples = align_sample(reader_from_panel(source, Method.NORMXCORR), lambda _: frames)
    assert len(samples) == len(motions)
    off = [
        np.hypot(*(carried(one.alignment.matrix, RIM) - carried(motion, RIM))).max()
        for one, motion in zip(samples, motions, strict=True)
    ]
    return reader, float(max(off))


@pytest.mark.parametrize(
    ("motions", "is_upright"),
    [
        ([turn(shift_px=(step, 0.0)) for step in range(8)], True),
        ([turn(roll_deg=12.0 * np.sin(step)) for step in range(8)], False),
        ([turn(tilt=(0.4, -0.3), scale=0.9, shift_px=(step, 0.0)) for step in range(8)], None),
    ],
    ids=["shifts only", "rolls", "stands elsewhere"],
)
def test_lone_anchor_holds_dials_in_place_however_the_camera_moves(
    motions: list[Floats], *, is_upright: bool | None
) -> None:
    """The rim is right to two pixels wherever the camera is; a rolling camera still rolls after a pivot is moved."""
    reader, off_px = aligned(motions)

    assert off_px < 2.0
    moved = around_pivots(reader, [(1.0, 0.0)], drawn=reader.source.panel.gauges)
    assert is_upright is None or moved.placement.is_upright is reader.placement.is_upright is is_upright
