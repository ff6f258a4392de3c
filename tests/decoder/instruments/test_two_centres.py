"""Two needles with their own centres in one case: each is a gauge, and never read for the other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from tests.decoder.instruments.dials import Canvas, Hand, paint, reader_for

LEFT, RIGHT = (60.4, 94.7), (148.6, 95.3)
TIP_PX = 48.0  # the pivots are 88 pixels apart: tips can cross by 8
# A tenth of a pixel at the mean radius, which one picture of the needle leaves unknown.
PANEL_PRECISION_DEG = 0.18
# Rises clockwise, evenly; falls clockwise (rises anticlockwise), unevenly.
TEMPERATURE = [[-60.0, 140.0], [-20.0, 60.0], [60.0, 0.0]]
PRESSURE = [[120.0, 0.0], [240.0, 200.0]]
GAUGES: list[dict[str, Any]] = [
    {
        "name": "oil temperature",
        "centre": list(LEFT),
        "radius": [18, 46],
        "sweep": [-60, 60],
        "unit": "C",
        "scale": TEMPERATURE,
        "needles": [{"name": "oil_c", "template": {"at": 30.0, "span": 26}}],
    },
    {
        "name": "oil pressure",
        "centre": list(RIGHT),
        "radius": [18, 46],
        "sweep": [120, 240],
        "unit": "psi",
        "scale": PRESSURE,
        "needles": [{"name": "oil_psi", "template": {"at": 215.0, "span": 26}}],
    },
]


def draw(left_deg: float, right_deg: float, seed: int = 0) -> GreyPicture:
    """Draws the case, the right needle above the left one."""

    def what(canvas: Canvas) -> None:
        canvas.disc((104.5, 95.0), 92.0, 35.0)
        for angle_deg in range(-60, 61, 20):
            canvas.bar(angle_deg, (50, 56), (1.2, 1.2), 190, LEFT)
            canvas.bar(180 + angle_deg, (50, 56), (1.2, 1.2), 190, RIGHT)
        canvas.hand(Hand(tip=TIP_PX, centre=LEFT), left_deg)
        canvas.hand(Hand(tip=TIP_PX, centre=RIGHT), right_deg)

    return paint(what, seed=seed)


@pytest.fixture(scope="module")
def reader() -> PanelReader:
    """A reader of both, tuned."""
    rng = np.random.default_rng(8)
    frames = [draw(rng.uniform(-60, 60), rng.uniform(120, 240), 100 + seed) for seed in range(16)]
    return reader_for(GAUGES, draw(30.0, 215.0, 1), frames)


def places() -> list[tuple[float, float]]:
    """Angles anywhere, and such that one tip lies in the other's ring."""
    rng = np.random.default_rng(9)
    apart = [(rng.uniform(-58, 58), rng.uniform(122, 238)) for _ in range(20)]
    return apart + [(around + shift, 180.0 + around) for around in (-12.0, 0.0, 9.0) for shift in np.linspace(-8, 8, 5)]


def test_each_needle_is_read_by_its_own_centre(reader: PanelReader) -> None:
    """Wherever the two are, neither is taken for the other, and where tips cross a reading is right or missing."""
    errors: dict[str, list[float]] = {"oil_c": [], "oil_psi": []}
    missing = 0
    for seed, (left_deg, right_deg) in enumerate(places()):
        readings = read_picture(reader, draw(left_deg, right_deg, seed)).readings
        for name, angle_deg in (("oil_c", left_deg), ("oil_psi", right_deg)):
            missing += readings[name].status is Status.MISSING
            if readings[name].status is not Status.MISSING:
                errors[name].append(abs(readings[name].angle_deg - angle_deg))

    assert missing <= 4
    for found in errors.values():
        assert np.mean(found) < 0.1 + PANEL_PRECISION_DEG
        assert max(found) < 0.02 * 120.0
