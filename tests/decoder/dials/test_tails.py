"""Tails: the end of a needle that points the other way is never read for its tip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Reading, Status
from decoder.scale import shortest

Paint = Callable[..., GreyPicture]
Draw = Callable[..., GreyPicture]
SWEEPS = {"arc": (120.0, 420.0), "circle": (270.0, 630.0)}
TIP_PX = 64.0
# Lengths of tails as wide and as bright as the needle, in a ring from 20 to 66 pixels.
TAILS_PX = {"inner": 30.0, "half": 45.0, "long": 60.0}


def off_deg(reading: Reading, angle_deg: float) -> float:
    """How far a reading is off, the short way round."""
    return float(abs(shortest(np.array(reading.angle_deg - angle_deg), 360.0)))


@pytest.fixture(scope="module")
def draw_with(paint: Paint, hand: Any) -> Callable[..., Draw]:  # noqa: ANN401
    """Makes a function that draws a dial with a needle as wide at its tip as at the end of its tail."""

    def make(tail_px: float) -> Draw:
        form = hand(tip=TIP_PX, tail=tail_px, root_half=2.6, tip_half=2.6, tail_half=2.6)

        def draw(angle_deg: float, seed: int = 0) -> GreyPicture:
            return paint(lambda canvas: (canvas.dial(range(0, 360, 30)), canvas.hand(form, angle_deg)), seed=seed)

        return draw

    return make


@pytest.fixture(scope="module")
def reader_with(draw_with: Callable[..., Draw], reader_for: Callable[..., PanelReader]) -> Callable[..., PanelReader]:
    """A tuned reader of such a dial."""

    def make(tail_px: float, sweep: tuple[float, float], *, tail: bool) -> PanelReader:
        draw, (first, last) = draw_with(tail_px), sweep
        gauge = {
            "name": "rpm",
            "radius": [20, 66],
            "sweep": list(sweep),
            "tail": tail,
            "scale": [[first, 0], [last, 300]],
            "needles": [{"name": "rpm", "template": {"at": 214.0, "span": 16}}],
        }
        frames = [draw(first + 3.0 + (last - first) * step / 16, 100 + step) for step in range(16)]
        return reader_for([gauge], draw(214.0, 1), frames)

    return make


@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
@pytest.mark.parametrize("tail_px", TAILS_PX.values(), ids=TAILS_PX)
def test_tip_is_read_whatever_the_tail(
    reader_with: Callable[..., PanelReader],
    draw_with: Callable[..., Draw],
    tail_px: float,
    sweep: tuple[float, float],
) -> None:
    """A tail of the needle's width and brightness, nearly as long as its tip, is a tail at every angle."""
    reader, draw = reader_with(tail_px, sweep, tail=True), draw_with(tail_px)
    angles_deg = np.random.default_rng(5).uniform(*sweep, 40)
    readings = [reader.read(draw(angle, seed)).readings["rpm"] for seed, angle in enumerate(angles_deg)]
    errors = [off_deg(reading, angle) for reading, angle in zip(readings, angles_deg, strict=True)]

    assert {reading.status for reading in readings} == {Status.READ}
    assert np.mean(errors) < 0.1
    assert max(errors) < 0.4


@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
def test_short_tail_does_no_harm_without_the_key(
    reader_with: Callable[..., PanelReader], draw_with: Callable[..., Draw], sweep: tuple[float, float]
) -> None:
    """A template that was cut at the tip alone still knows the tip from a shorter tail."""
    reader, draw = reader_with(45.0, sweep, tail=False), draw_with(45.0)
    angles_deg = np.random.default_rng(6).uniform(*sweep, 30)
    readings = [reader.read(draw(angle, seed)).readings["rpm"] for seed, angle in enumerate(angles_deg)]

    assert {reading.status for reading in readings} == {Status.READ}
    assert max(off_deg(reading, angle) for reading, angle in zip(readings, angles_deg, strict=True)) < 0.4


@pytest.fixture(scope="module")
def mirrored(reader_with: Callable[..., PanelReader]) -> PanelReader:
    """A reader of a needle whose ends are alike."""
    return reader_with(TIP_PX, SWEEPS["circle"], tail=True)


@given(angle_deg=st.floats(0.0, 360.0))
@example(angle_deg=34.0)  # right where the panel picture has the tail: there the dial behind it is known least
@settings(max_examples=30)
def test_ends_that_are_alike_are_not_guessed(
    mirrored: PanelReader, draw_with: Callable[..., Draw], angle_deg: float
) -> None:
    """Where nothing tells the tip from the tail there is no value, or the right one."""
    reading = mirrored.read(draw_with(TIP_PX)(angle_deg, 3)).readings["rpm"]

    assert reading.status is Status.MISSING or off_deg(reading, angle_deg) < 0.4
