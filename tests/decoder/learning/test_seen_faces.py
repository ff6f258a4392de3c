"""The dial behind a panel picture's needles: learned from the flight, and never from a needle that hardly moved."""

from __future__ import annotations

import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight
from tests.decoder.instruments.dials import Canvas, Hand, apart, paint, reader_for

SLOW, FAST = Hand(tip=44.0, root_half=5.0, tip_half=3.5), Hand()
SLOW_DEG, FAST_DEG = 300.0, 220.0
DIAL = {
    "name": "dial",
    "radius": [16, 66],
    "sweep": [180, 520],
    "unit": "pct",
    "scale": [[180, 0], [520, 100]],
    "needles": [
        {"name": "slow_pct", "template": {"at": SLOW_DEG, "span": 60}, "covered_by": "fast_pct"},
        {"name": "fast_pct", "template": {"at": FAST_DEG, "span": 20}},
    ],
}


def drawn(slow_deg: float, fast_deg: float, seed: int = 0) -> GreyPicture:
    """Draws a wide needle under a narrow one."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 10))
        canvas.hand(SLOW, slow_deg)
        canvas.hand(FAST, fast_deg)

    return paint(what, seed=seed)


@pytest.mark.parametrize("moved_deg", [1.5, 3.0])
def test_needle_that_moved_by_less_than_its_width_is_no_face(moved_deg: float) -> None:
    """Most of it stays where the panel picture has it: only its edges show the dial, while another needle turns."""
    truth = [{"slow_pct": SLOW_DEG + moved_deg, "fast_pct": 190.0 + 20.0 * frame} for frame in range(16)]
    frames = [drawn(*angles.values(), seed=1 + frame) for frame, angles in enumerate(truth)]
    reader = fit_to_flight(reader_for([DIAL], drawn(SLOW_DEG, FAST_DEG)), lambda _: frames).reader
    found = [read_picture(reader, frame).readings for frame in frames]

    read = [(own[name], deg) for own, angles in zip(found, truth, strict=True) for name, deg in angles.items()]
    certain = [(reading, deg) for reading, deg in read if reading.status is Status.READ]
    assert len(certain) >= 28  # of 32; the narrow needle goes over the wide one
    assert all(apart(reading.angle_deg, deg) < 0.5 for reading, deg in certain)
