"""Balls in curved tubes: where they are, dark or bright, whoever drew the tube."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight
from decoder.panel.gauge import Gauge
from decoder.panel.scale import Scale
from tests.decoder.instruments.dials import Canvas, paint, reader_for

CENTRE, RADIUS_PX, HALF_DEG = (104.4, -60.0), 150.0, 17.0
WIDTH_PX, BALL_PX = 16.0, 7.2
PANEL_VALUE = 0.15


def place(value: float) -> tuple[float, float]:
    """The ball's middle, from -1 at the right end of its way to 1 at the left."""
    at = math.radians(90.0 + HALF_DEG * value)
    return CENTRE[0] + RADIUS_PX * math.cos(at), CENTRE[1] + RADIUS_PX * math.sin(at)


def draw(
    value: float | None,
    seed: int = 0,
    levels: tuple[float, float] = (205.0, 25.0),
    over: Callable[[Canvas], object] = lambda _: None,
) -> GreyPicture:
    """Draws a tube between two lines at its middle, with a ball that has a glint."""
    tube, ball = levels

    def what(canvas: Canvas) -> None:
        ends = np.radians(90.0 + np.linspace(-HALF_DEG - 4.0, HALF_DEG + 4.0, 60))
        for sign, level in ((0.5, tube), (0.42, tube)):
            outer, inner = RADIUS_PX + sign * WIDTH_PX, RADIUS_PX - sign * WIDTH_PX
            rims = [(outer, a) for a in ends] + [(inner, a) for a in ends[::-1]]
            canvas.polygon([(CENTRE[0] + r * math.cos(a), CENTRE[1] + r * math.sin(a)) for r, a in rims], level)
        for beside_deg in (-3.4, 3.4):
            canvas.bar(90.0 + beside_deg, (RADIUS_PX - 8.0, RADIUS_PX + 8.0), (0.6, 0.6), 90.0, CENTRE)
        if value is not None:
            x, y = place(value)
            canvas.disc((x, y), BALL_PX, ball)
            canvas.disc((x - 1.5, y - 2.5), 1.4, 0.5 * (tube + ball))
        over(canvas)

    return paint(what, seed=seed)


def gauge(off_px: tuple[float, float] = (0.0, 0.0), width_px: float = WIDTH_PX) -> dict[str, Any]:
    """A tube drawn this far from its place."""
    tube = [[*np.add(place(value), off_px).tolist(), value] for value in (-1.0, 0.0, 1.0)]
    return {"name": "slip", "ball": {"name": "ball", "tube": tube, "width": width_px}}


def fitted(own: dict[str, Any], levels: tuple[float, float] = (205.0, 25.0)) -> PanelReader:
    """A reader fitted to a flight in which the ball went to and fro, mostly near its middle."""
    values = 0.45 * np.sin(np.arange(16) * 1.3) + np.where(np.arange(16) % 5 == 0, 0.5, 0.0)
    frames = [draw(float(value), 100 + seed, levels) for seed, value in enumerate(values)]
    return fit_to_flight(reader_for([own], draw(PANEL_VALUE, 1, levels)), lambda _: frames).reader


def value_of(reader: PanelReader, frame: GreyPicture) -> tuple[Status, float, float]:
    """Status of the ball, its value and sigma."""
    reading = read_picture(reader, frame).readings["ball"]
    scale = Scale.of(reader.source.panel.gauges[0].scale)
    angles = np.array([reading.angle_deg])
    return (
        reading.status,
        float(scale.values_at(angles)[0]),
        float(abs(scale.slopes_at(angles)[0]) * reading.sigma_deg),
    )


@pytest.mark.parametrize("levels", [(205.0, 25.0), (40.0, 220.0)], ids=["dark", "bright"])
def test_ball_is_read_along_its_tube(levels: tuple[float, float]) -> None:
    """Its look and its place in the panel picture are not given; it is also right at its stops."""
    reader = fitted(gauge(), levels)

    for number, value in enumerate([-1.0, -0.93, -0.61, -0.2, -0.03, 0.0, 0.31, 0.77, 1.0]):
        status, read, _ = value_of(reader, draw(value, number, levels))
        assert status is Status.READ
        assert abs(read - value) < 0.02


@pytest.mark.parametrize("off_px", [(0.0, 1.5), (-1.1, -1.1)])
def test_tube_that_is_drawn_beside_its_place_is_read_as_it_is_drawn(off_px: tuple[float, float]) -> None:
    """A ball is as far off as its tube, which sigma covers, and no farther: no far pivot is searched for."""
    reader = fitted(gauge(off_px, WIDTH_PX + 3.0))

    for number, value in enumerate([-0.9, -0.3, 0.0, 0.6]):
        status, read, sigma = value_of(reader, draw(value, number))
        assert status is Status.READ
        assert abs(read - value) < min(0.045, 3.0 * sigma)


def test_ball_is_found_in_changing_light_between_dark_ends_of_its_tube() -> None:
    """In sun and shadow everything changes, and the tube's ends differ from its middle as much as the ball does."""

    def lit(value: float, number: int) -> GreyPicture:
        def over(canvas: Canvas) -> None:
            for sign in (-1.0, 1.0):
                canvas.bar(90.0 + sign * (HALF_DEG + 0.5), (RADIUS_PX - 12.0, RADIUS_PX + 12.0), (9, 9), 20.0, CENTRE)

        frame = draw(value, 100 + number, over=over)
        y, x = np.indices(frame.shape)
        near = np.hypot(x - CENTRE[0], y - CENTRE[1] - RADIUS_PX) < 70.0
        mirrored = 25.0 * ((x > CENTRE[0] + 30.0) == (number % 2 == 0)) * (number % 3 > 0)
        return np.clip(np.where(near, 0.8 * frame + mirrored, frame), 0, 255).astype(np.uint8)

    values = [0.5 * math.sin(1.3 * number) for number in range(16)]
    frames = [lit(value, number) for number, value in enumerate(values)]
    reader = fit_to_flight(reader_for([gauge()], lit(PANEL_VALUE, 1)), lambda _: frames).reader

    for value, frame in zip(values, frames, strict=True):
        status, read, _ = value_of(reader, frame)
        assert status is Status.READ
        assert abs(read - value) < 0.03


def test_ball_that_is_covered_or_gone_is_missing() -> None:
    """Lines and ends of the tube are not taken for it, nor is a hand."""
    reader = fitted(gauge())
    hand = draw(0.2, 3, over=lambda canvas: canvas.bar(0.0, (60, 140), (12, 12), 150, (0.0, place(0.0)[1])))

    assert value_of(reader, draw(None, 2))[0] is Status.MISSING
    status, read, _ = value_of(reader, hand)
    assert status is Status.MISSING or abs(read - 0.2) < 0.05


def test_ball_that_never_moves_is_missing() -> None:
    """A feature that does not move along the tube is not known to be a ball."""
    frames = [draw(PANEL_VALUE, seed) for seed in range(16)]
    reader = fit_to_flight(reader_for([gauge()], draw(PANEL_VALUE, 1)), lambda _: frames).reader

    assert value_of(reader, draw(PANEL_VALUE, 40))[0] is Status.MISSING


def test_tube_tells_the_dial() -> None:
    """Its circle, its width and its values; a straight one is bent invisibly."""
    own = Gauge.model_validate(gauge())
    straight = Gauge.model_validate(
        {"name": "slip", "ball": {"name": "ball", "tube": [[10, 50, -1], [60, 50, 0], [110, 50, 1]], "width": 9}}
    )
    (line,) = own.lines({"ball": 0.0}).values()

    assert own.centre == pytest.approx(CENTRE, abs=1e-6)
    assert own.radius == pytest.approx((RADIUS_PX - 8.0, RADIUS_PX + 8.0))
    assert line is not None
    assert line[0] == pytest.approx((90.0, RADIUS_PX - 8.0))
    assert sum(straight.radius) / 2 == pytest.approx(1200.0, rel=0.01)
