"""A three-pointer altimeter, drawn: its panel entry, where its pointers are at an altitude, and pictures of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from decoder.imaging.pictures import GreyPicture
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, paint

TURNS_FT = {"ten_thousands_ft": 100_000.0, "thousands_ft": 10_000.0, "hundreds_ft": 1_000.0}
PANEL_DEG = (20.0, 140.0, 250.0)


def marks(turn_ft: float) -> list[list[float]]:
    """Marks of a scale that begins at the top."""
    return [[270.0, 0.0], [450.0, turn_ft / 2]]


ALTIMETER: dict[str, Any] = {
    "name": "altimeter",
    "radius": [16, 66],
    "sweep": [270, 630],
    "unit": "ft",
    "scale": marks(1000.0),
    "wraps": 1000,
    "combined": {"name": "altitude_ft", "needles": ["hundreds_ft", "thousands_ft", "ten_thousands_ft"]},
    "needles": [
        {
            "name": "ten_thousands_ft",
            "template": {"at": PANEL_DEG[0], "span": 30},
            "covered_by": "thousands_ft",
            "scale": marks(100_000.0),
            "wraps": 100_000,
        },
        {
            "name": "thousands_ft",
            "template": {"at": PANEL_DEG[1], "span": 32},
            "covered_by": "hundreds_ft",
            "scale": marks(10_000.0),
            "wraps": 10_000,
        },
        {"name": "hundreds_ft", "template": {"at": PANEL_DEG[2], "span": 20}},
    ],
}

FORMS = (
    Hand(tip=34.0, root_half=3.0, tip_half=1.5, level=215.0),
    Hand(tip=46.0, root_half=4.0, tip_half=3.0, level=225.0),
    Hand(tip=64.0, root_half=2.2, tip_half=1.2, level=235.0),
)
"""A small pointer below a short wide one below a long one."""


def angles_of(altitude_ft: float) -> tuple[float, ...]:
    """Where the pointers are, the coarsest first."""
    return tuple(270.0 + altitude_ft / turn_ft * 360.0 for turn_ft in TURNS_FT.values())


def drawn(angles_deg: Sequence[float], forms: Sequence[Hand] = FORMS, seed: int = 0) -> GreyPicture:
    """Draws an altimeter with hands at such angles, the lowest first."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 36))
        for form, angle_deg in zip(forms, angles_deg, strict=True):
            canvas.hand(form, angle_deg)
        canvas.disc(CENTRE, 9.0, 60.0)

    return paint(what, seed=seed)
