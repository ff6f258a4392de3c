"""Dials that go all the way round: all angles are equivalent, and values repeat after a turn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from decoder.panel.scale import Scale
from tests.decoder.instruments.dials import Hand, apart, paint, reader_for

TICKS_DEG = tuple(range(0, 360, 30))
PANEL_DEG, LONG_DEG = 214.0, 20.0
HEADING: dict[str, Any] = {
    "name": "heading",
    "radius": [20, 66],
    "sweep": [270, 630],
    "unit": "deg",
    "scale": [[270, 0], [360, 90], [450, 180], [540, 270]],
    "wraps": 360,
    "needles": [{"name": "heading_deg", "template": {"at": PANEL_DEG, "span": 16}}],
}


def heading(angle_deg: float, **camera: Any) -> GreyPicture:  # noqa: ANN401
    """Draws a heading indicator."""
    return paint(lambda canvas: (canvas.dial(TICKS_DEG), canvas.hand(Hand(), angle_deg)), **camera)


@pytest.fixture(scope="module")
def compass() -> PanelReader:
    """A reader of it, tuned to a flight once around."""
    frames = [heading(float(angle), seed=50 + index) for index, angle in enumerate(np.arange(16) * 22.5 + 3.0)]
    return reader_for([HEADING], heading(PANEL_DEG, seed=1), frames)


@given(angle_deg=st.floats(0.0, 360.0))
@example(angle_deg=270.0)
@example(angle_deg=269.999)
@example(angle_deg=269.75)
@example(angle_deg=270.3)
@settings(max_examples=25)
def test_dial_has_no_seam(compass: PanelReader, angle_deg: float) -> None:
    """A needle is read equally well at every angle, also where the unwrapped gauge ends."""
    reading = read_picture(compass, heading(angle_deg, seed=2)).readings["heading_deg"]

    assert reading.status is Status.READ
    assert apart(reading.angle_deg, angle_deg) < 0.25
    assert 270.0 <= reading.angle_deg < 630.0
    assert reading.score > 0.95


@pytest.mark.parametrize("turns", [-2, 2])
def test_a_needle_may_be_drawn_turns_away_from_the_sweep(turns: int) -> None:
    """An angle measured from -180 to 180 is as good as one within a sweep from 270 to 630."""
    drawn = {"name": "heading_deg", "template": {"at": PANEL_DEG + turns * 360.0, "span": 16}}
    reader = reader_for([{**HEADING, "needles": [drawn]}], heading(PANEL_DEG, seed=1), [])

    reading = read_picture(reader, heading(31.0, seed=2)).readings["heading_deg"]

    assert reading.status is Status.READ
    assert apart(reading.angle_deg, 31.0) < 0.25


PAIR: dict[str, Any] = {
    **HEADING,
    "needles": [
        {"name": "short_h", "template": {"at": PANEL_DEG, "span": 18}, "covered_by": "long_min"},
        {"name": "long_min", "template": {"at": LONG_DEG, "span": 16}},
    ],
}


def clock(short_deg: float, long_deg: float, **camera: Any) -> GreyPicture:  # noqa: ANN401
    """Draws a dial with a long needle above a short wide one."""
    short = Hand(tip=46.0, root_half=4.0, tip_half=3.0, level=215.0)
    return paint(
        lambda canvas: (canvas.dial(TICKS_DEG), canvas.hand(short, short_deg), canvas.hand(Hand(), long_deg)),
        **camera,
    )


@pytest.fixture(scope="module")
def clock_reader() -> PanelReader:
    """A reader of both needles, tuned."""
    rng = np.random.default_rng(4)
    frames = [clock(*rng.uniform(0, 360, 2), seed=80 + index) for index in range(16)]
    return reader_for([PAIR], clock(PANEL_DEG, LONG_DEG, seed=1), frames)


@pytest.mark.parametrize("long_deg", [270.0, 271.7, 100.0])
@pytest.mark.parametrize("off_deg", [-40.0, -8.0, -5.0, 5.0, 14.0, 180.0])
def test_two_needles_cross_the_seam_together(clock_reader: PanelReader, long_deg: float, off_deg: float) -> None:
    """Needles beside each other are read wherever they are, one on each side of the seam as well.

    If their soft edges overlap, the covered one is less certain, and reports it.
    """
    readings = read_picture(clock_reader, clock(long_deg + off_deg, long_deg, seed=5)).readings

    assert readings["long_min"].status is Status.READ
    assert apart(readings["long_min"].angle_deg, long_deg) < 0.3
    assert readings["short_h"].status in (Status.READ, Status.EDGE)
    assert apart(readings["short_h"].angle_deg, long_deg + off_deg) < 0.5 + 4 * readings["short_h"].sigma_deg < 1.8


@given(
    first_deg=st.floats(0.0, 360.0),
    rising=st.booleans(),
    wraps=st.sampled_from([12.0, 360.0, 1000.0]),
    angle_deg=st.floats(-720.0, 720.0),
)
def test_round_scale_repeats_every_turn(first_deg: float, rising: bool, wraps: float, angle_deg: float) -> None:  # noqa: FBT001
    """A turn later the value is the same; values are within one turn, and lead back to the angle."""
    sign = 1.0 if rising else -1.0
    marks = [(first_deg, 0.25 * wraps), (first_deg + 90.0, 0.25 * wraps + sign * 0.1 * wraps)]
    scale = Scale.of(marks, wraps)
    here, there = scale.values_at(np.array([angle_deg, angle_deg + 360.0]))

    assert 0.0 <= here < wraps
    assert apart(here, there, wraps) < 1e-6
    back_deg = float(scale.angles_of(np.array([here]))[0])
    assert apart(back_deg, angle_deg) < 1e-4
