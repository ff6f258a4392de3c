"""Dials with marks all the way round, seen obliquely: the marks show it, and needles are read between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight
from decoder.learning.obliqueness import squeezes_seen
from decoder.panel.scale import Scale
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, paint, reader_for
from tests.decoder.instruments.test_cards import appears_deg, aside

MINUTES_DEG = [6.0 * minute for minute in range(60)]
PANEL_DEG = 200.0


def clock(needle_deg: float, marks_deg: Sequence[float] = MINUTES_DEG, seed: int = 0) -> GreyPicture:
    """A dial with one hand, which ends short of its marks."""

    def what(canvas: Canvas) -> None:
        canvas.dial(marks_deg)
        canvas.bar(300.0, (30.0, 44.0), (3.0, 3.0), 120.0)
        canvas.hand(Hand(tip=58.0), needle_deg)

    return paint(what, seed=seed)


def drawn_aside(squeeze: Squeeze, marks: int = 2, missed_deg: float = 0.0) -> dict[str, Any]:
    """A clock's minutes as somebody draws them who gives marks as they appear, its centre a little off."""
    values = [60.0 / marks * mark for mark in range(marks)]
    off_deg = np.random.default_rng(3).normal(0.0, missed_deg, marks).tolist()
    return {
        "name": "clock",
        "centre": [CENTRE[0] + 0.8, CENTRE[1] - 0.6],
        "radius": [16, 56],
        "sweep": [270, 630],
        "scale": [
            [appears_deg(270.0 + 6.0 * own, squeeze) + off, own] for own, off in zip(values, off_deg, strict=True)
        ],
        "wraps": 60,
        "needles": [{"name": "minute_min", "template": {"at": appears_deg(PANEL_DEG, squeeze), "span": 16}}],
    }


def test_squeeze_is_found_from_marks_beyond_the_needle() -> None:
    """Sixty even marks appear uneven on an ellipse."""
    squeeze = Squeeze(0.012, -0.028)
    reader = reader_for([drawn_aside(squeeze)], aside(clock(PANEL_DEG), squeeze))

    (found,), _ = squeezes_seen(reader.source)

    assert found is not None
    assert np.allclose(found.matrix, squeeze.matrix, atol=0.003)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("marks_deg", "squeeze"),
    [(MINUTES_DEG, Squeeze(0.0, 0.0)), (MINUTES_DEG[:45], Squeeze(0.02, 0.02)), ([], Squeeze(0.02, 0.02))],
    ids=["seen square on", "marks part of the way round", "no marks"],
)
def test_dial_stays_as_drawn_where_its_marks_do_not_show_a_squeeze(
    marks_deg: Sequence[float], squeeze: Squeeze
) -> None:
    """Only marks all the way round show it; and there has to be one."""
    reader = reader_for([drawn_aside(squeeze)], aside(clock(PANEL_DEG, marks_deg), squeeze))

    assert squeezes_seen(reader.source) == ((None,), (None,))


@pytest.mark.parametrize("marks", [8, 12])
def test_squeeze_is_found_from_many_marks_that_were_drawn(marks: int) -> None:
    """Where the picture shows none, those that a hand drew, half a degree off each, still show the view."""
    squeeze = Squeeze(0.03, -0.06)
    blank = aside(clock(PANEL_DEG, []), squeeze)

    found, none = (
        squeezes_seen(reader_for([drawn_aside(own, marks, 0.5)], blank).source)[0][0]
        for own in (squeeze, Squeeze(0.0, 0.0))
    )

    assert found is not None
    assert np.allclose(found.matrix, squeeze.matrix, atol=0.01)
    assert none is None


def test_needle_is_read_between_two_marks_of_a_dial_seen_from_aside() -> None:
    """On an ellipse a needle between two marks appears up to two degrees from where it is on the dial."""
    squeeze = Squeeze(0.012, -0.028)
    frames = [aside(clock(3.0 + 22.5 * step, seed=100 + step), squeeze) for step in range(16)]

    fitted = fit_to_flight(reader_for([drawn_aside(squeeze)], aside(clock(PANEL_DEG), squeeze)), lambda _: frames)

    (gauge,) = fitted.panel.gauges
    scale = Scale.of(gauge.scale, 60.0)
    for needle_deg in (20.0, 77.0, 140.0, 233.0, 310.0):
        reading = read_picture(fitted.reader, aside(clock(needle_deg, seed=9), squeeze)).readings["minute_min"]
        (value,) = scale.values_at(np.array([reading.angle_deg]))
        assert reading.status is Status.READ
        assert 6.0 * apart(float(value), (needle_deg - 270.0) / 6.0, 60.0) < 0.5
    assert "is seen from about" in fitted.findings["clock"][0]
