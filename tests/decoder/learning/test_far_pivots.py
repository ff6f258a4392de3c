"""Centres drawn far beside where needles and cards turn: they are found, or left where they are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import FittedReader, fit_to_flight
from tests.decoder.instruments import test_cards as cards
from tests.decoder.instruments.dials import CENTRE, Hand, paint, reader_for

RADIUS_PX = 70.0
PANEL_DEG = 200.0
GAUGE: dict[str, Any] = {
    "name": "speed",
    "radius": [20, 70],
    "sweep": [120, 420],
    "scale": [[120, 0], [420, 300]],
    "needles": [{"name": "speed_kt", "template": {"at": PANEL_DEG, "span": 16}}],
}
TICKS_DEG = [120.0 + 25 * mark for mark in range(13)]


def draw(angle_deg: float, seed: int = 0) -> Any:  # noqa: ANN401 - a picture
    """A dial with numerals' worth of marks and a tapered needle."""

    def what(canvas: Any) -> None:  # noqa: ANN401
        canvas.dial(TICKS_DEG)
        for mark in range(12):
            canvas.bar(132.0 + 25 * mark, (44.0, 52.0), (3.0, 3.0), 120.0)
        canvas.hand(Hand(), angle_deg)

    return paint(what, seed=seed)


def drawn_beside(gauge: dict[str, Any], part: float, towards_deg: float) -> dict[str, Any]:
    """The gauge with its centre a part of the radius off."""
    towards = math.radians(towards_deg)
    far_px = part * gauge["radius"][1]
    return {**gauge, "centre": [CENTRE[0] + far_px * math.cos(towards), CENTRE[1] + far_px * math.sin(towards)]}


def fitted_to(angles_deg: np.ndarray[Any, np.dtype[np.float64]], part: float, towards_deg: float) -> FittedReader:
    """Fit to a flight with the needle at these angles, its centre drawn a part of the radius off."""
    frames = [draw(angle_deg, 50 + seed) for seed, angle_deg in enumerate(angles_deg.tolist())]
    return fit_to_flight(reader_for([drawn_beside(GAUGE, part, towards_deg)], draw(PANEL_DEG, 1)), lambda _: frames)


@pytest.mark.parametrize("part", [0.05, 0.1])
@pytest.mark.parametrize("towards_deg", [20.0, 110.0, 250.0])
def test_needle_turns_where_it_turns_however_its_centre_is_drawn(part: float, towards_deg: float) -> None:
    """A tenth of the radius off, the pivot is found, and readings are as good as those of a panel that is right."""
    fitted = fitted_to(np.linspace(125, 415, 16), part, towards_deg)
    moved_px = np.array(fitted.moved_px["speed"])
    towards = math.radians(towards_deg)

    assert moved_px == pytest.approx(-part * RADIUS_PX * np.array([math.cos(towards), math.sin(towards)]), abs=0.3)
    for angle_deg in (150.0, 260.0, 330.0, 400.0):
        reading = read_picture(fitted.reader, draw(angle_deg, 9)).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.angle_deg == pytest.approx(angle_deg, abs=0.6)


def test_centre_stays_where_no_needle_tells_another() -> None:
    """A needle that stands still, and one that turns about a centre that is drawn right, move nothing."""
    assert not fitted_to(np.full(16, PANEL_DEG), 0.08, 20.0).moved_px
    assert not fitted_to(np.linspace(125, 415, 16), 0.0, 0.0).moved_px


def test_marks_are_taken_to_be_drawn_as_carelessly_as_centres() -> None:
    """Where a centre turns out to be drawn far beside its pivot, a reading is less certain for its scale."""
    angles_deg = np.linspace(125, 415, 16)
    careful, careless = (fitted_to(angles_deg, part, 20.0).uncertainties["speed_kt"] for part in (0.0, 0.06))

    assert careless.drawn_deg > 2 * careful.drawn_deg


@pytest.mark.parametrize("towards_deg", [20.0, 200.0])
def test_card_is_read_however_its_centre_is_drawn(towards_deg: float) -> None:
    """Eight hundredths of the radius off, a heading is read in all frames."""
    turns_deg = [3.0 + 22.5 * step for step in range(16)]
    frames = [cards.draw(turn_deg, 100 + seed) for seed, turn_deg in enumerate(turns_deg)]
    gauge = drawn_beside(cards.CARD, 0.08, towards_deg)
    fitted = fit_to_flight(reader_for([gauge], cards.draw(cards.PANEL_TURN_DEG, 1)), lambda _: frames)

    assert math.hypot(*fitted.moved_px["heading"]) == pytest.approx(0.08 * RADIUS_PX, abs=0.5)
    for turn_deg in (10.0, 100.0, 190.0, 320.0):
        status, off, _ = cards.off_deg(fitted.reader, cards.draw(turn_deg, 7), turn_deg)
        assert status is Status.READ
        assert off < 0.6
