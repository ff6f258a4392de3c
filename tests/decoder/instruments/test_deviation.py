"""Course deviation and glideslope: a needle that swings about a point above its dial, a bar that moves in parallel."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from tests.decoder.instruments.dials import CENTRE, Canvas, paint, reader_for

PIVOT = (CENTRE[0], CENTRE[1] - 86.0)
"""Ten pixels above the rim."""
MOST_DEG = 28.0
TOP, BOTTOM = CENTRE[1] - 34.0, CENTRE[1] + 34.0
"""Where the bar stands at 10 and at -10."""


def draw(course: float, slope: float, seed: int = 0, *, blur: float = 0.7, noise: float = 3.0) -> GreyPicture:
    """An indicator with its dots; the course needle swings over the glideslope bar. Both go from -10 to 10."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 30))
        for part in (-1.0, -0.5, 0.5, 1.0):
            x = PIVOT[0] + 86.0 * math.tan(math.radians(MOST_DEG * part))
            canvas.disc((x, CENTRE[1]), 2.0, 190.0)
            canvas.disc((CENTRE[0], CENTRE[1] + 34.0 * part), 2.0, 190.0)
        height = CENTRE[1] - 3.4 * slope
        canvas.polygon(
            [(CENTRE[0] + x, height + y) for x, y in ((-46, -1.5), (46, -1.5), (46, 1.5), (-46, 1.5))], 215.0
        )
        angle_deg = 90.0 - MOST_DEG / 10.0 * course
        canvas.bar(angle_deg, (28.0, 128.0), (1.6, 1.6), 235.0, PIVOT)

    return paint(what, seed=seed, blur=blur, noise=noise)


def described(off_px: tuple[float, float], course: float, slope: float) -> list[dict[str, Any]]:
    """Both as drawn by a hand with the pivot this far off; marks are its clicks on the dots."""
    pivot = PIVOT[0] + off_px[0], PIVOT[1] + off_px[1]

    def seen_deg(value: float) -> float:
        x = PIVOT[0] + 86.0 * math.tan(math.radians(-MOST_DEG / 10.0 * value))
        return math.degrees(math.atan2(CENTRE[1] - pivot[1], PIVOT[0] * 2 - x - pivot[0]))

    marks = sorted([seen_deg(value), value] for value in (-10.0, -5.0, 0.0, 5.0, 10.0))
    edge = CENTRE[0] - 46.0
    return [
        {
            "name": "course",
            "centre": list(pivot),
            "radius": [34, 120],
            "sweep": [marks[0][0] - 2.0, marks[-1][0] + 2.0],
            "unit": "dots",
            "scale": marks,
            "needles": [{"name": "cdi_dots", "template": {"at": seen_deg(course), "span": 14}}],
        },
        {
            "name": "glideslope",
            "window": [[edge, TOP - 6], [edge + 22, TOP - 6], [edge + 22, BOTTOM + 6], [edge, BOTTOM + 6]],
            "unit": "dots",
            "linear": {
                "name": "gs_dots",
                "moves": "down",
                "at": CENTRE[1] - 3.4 * slope,
                "span": 12,
                "marks": [[TOP, 10], [CENTRE[1], 0], [BOTTOM, -10]],
            },
        },
    ]


@pytest.mark.parametrize(("off_px", "blur"), [((0.0, 0.0), 1.3), ((2.0, -3.0), 0.7), ((-2.0, 4.0), 1.3)])
def test_both_are_read_within_two_percent(off_px: tuple[float, float], blur: float) -> None:
    """A needle's centre is its pivot, wherever that is; a bar that moves in parallel slides along a scale."""
    rng = np.random.default_rng(4)
    places = rng.uniform(-9.5, 9.5, (40, 2)).tolist()
    frames = [draw(course, slope, 100 + seed, blur=blur) for seed, (course, slope) in enumerate(places[:16])]
    reader = reader_for(described(off_px, 3.0, -4.0), draw(3.0, -4.0, 1, blur=blur), frames)

    errors: dict[str, list[float]] = {"cdi_dots": [], "gs_dots": []}
    for seed, both in enumerate(places[16:]):
        readings = read_picture(reader, draw(*both, seed, blur=blur)).readings
        for (name, own), value, gauge in zip(readings.items(), both, reader.source.panel.gauges, strict=True):
            if own.status is Status.READ:
                (quantity,) = gauge.quantities
                read = float(np.interp(own.angle_deg, *np.array(quantity.marks).T))
                errors[name].append(abs(read - value))
    for name, off in errors.items():
        assert max(off) <= 0.02 * 20.0, name
        assert len(off) >= 20, name
