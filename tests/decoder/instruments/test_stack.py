"""Needles on one dial that differ in size are read though one is drawn over a printed mark."""

from __future__ import annotations

from typing import Any

import numpy as np

from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight
from tests.decoder.instruments.dials import Canvas, Hand, apart, paint, reader_for

WIDE = Hand(tip=60.0, root_half=5.0, tip_half=1.0)
DIM = Hand(tip=66.0, root_half=1.3, tip_half=1.3, level=110.0)


def marked(wide_deg: float, thin_deg: float, seed: int = 0) -> GreyPicture:
    """A clock's face of long bright marks, with a wide hand below a dim thin one."""

    def what(canvas: Canvas) -> None:
        canvas.dial(())
        for angle_deg in range(0, 360, 30):
            canvas.bar(angle_deg, (42.0, 70.0), (2.0, 2.0), 240.0)
        canvas.hand(WIDE, wide_deg)
        canvas.hand(DIM, thin_deg)

    return paint(what, seed=seed)


def test_a_needle_drawn_over_a_mark_is_read_where_no_mark_is() -> None:
    """A mark behind a needle in the panel picture is not learned as a part of it, though most places have none."""
    gauge: dict[str, Any] = {
        "name": "clock",
        "radius": [16, 68],
        "sweep": [270, 630],
        "scale": [[270, 0], [450, 30]],
        "wraps": 60,
        "needles": [
            {"name": "wide", "template": {"at": 160.0, "span": 22}, "covered_by": "thin"},
            {"name": "thin", "template": {"at": 30.0, "span": 10}},
        ],
    }
    angles_deg = [(160.0 + step, 30.0 + 44.0 * step) for step in range(16)]
    frames = [FramePicture(marked(*both, 9 + at), None) for at, both in enumerate(angles_deg)]
    reader = fit_to_flight(reader_for([gauge], marked(160.0, 30.0, 1)), lambda _: frames).reader
    asked_deg = [(170.0, angle_deg) for angle_deg in np.arange(275.0, 500.0, 17.0).tolist()]
    found = [read_picture(reader, marked(*both, seed)).readings["thin"] for seed, both in enumerate(asked_deg)]
    pairs = zip(found, asked_deg, strict=True)
    off = [apart(own.angle_deg, thin) for own, (_, thin) in pairs if own.status is Status.READ]

    assert len(off) >= 0.8 * len(asked_deg)
    assert max(off) < 0.5


def crossing(low: Hand, low_deg: float, high_deg: float, seed: int = 0) -> GreyPicture:
    """A dial with a wide bright hand over another one."""
    high = Hand(root_half=4.0, tip_half=3.0)
    return paint(
        lambda canvas: (canvas.dial(range(120, 421, 30)), canvas.hand(low, low_deg), canvas.hand(high, high_deg)),
        seed=seed,
    )


def test_needle_is_not_hidden_while_the_dial_shows_something_as_large_elsewhere() -> None:
    """One that a glint or a bad cut keeps from being found is missing; one that lies below another has its place."""
    gauge: dict[str, Any] = {
        "name": "both",
        "radius": [16, 66],
        "sweep": [120, 420],
        "scale": [[120, 0], [420, 100]],
        "needles": [
            {"name": "low", "template": {"at": 160.0, "span": 12}, "covered_by": "high"},
            {"name": "high", "template": {"at": 300.0, "span": 20}},
        ],
    }
    low, glinting = (
        Hand(tip=56.0, root_half=2.0, level=110.0),
        Hand(tip=56.0, root_half=1.0, tip_half=6.0, level=140.0),
    )
    reader = reader_for([gauge], crossing(low, 160.0, 300.0, 1))
    askew = [read_picture(reader, crossing(glinting, deg, 300.0, 2)).readings for deg in (170.0, 215.0, 350.0)]
    below = read_picture(reader, crossing(low, 300.5, 300.0, 3)).readings

    assert [own["high"].status for own in askew] == [Status.READ] * 3
    assert [own["low"].status for own in askew] == [Status.MISSING] * 3
    assert below["low"].status is Status.HIDDEN
    assert apart(below["low"].angle_deg, 300.5) < 2 * below["low"].sigma_deg
