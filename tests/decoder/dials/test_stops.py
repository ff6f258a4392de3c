"""Stops: a needle beyond the last mark, or at rest outside the scale, is read where it stands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Status
from decoder.scale import Scale

Paint = Callable[..., GreyPicture]
GAUGE: dict[str, Any] = {
    "name": "pressure",
    "radius": [20, 66],
    "sweep": [135, 405],
    "stops": [118, 418],
    "unit": "psi",
    "scale": [[135, 0], [270, 50], [405, 200]],
    "needles": [{"name": "oil_psi", "template": {"at": 214.0, "span": 16}}],
}


@pytest.fixture(scope="module")
def pressure(paint: Paint, hand: Any) -> Callable[..., GreyPicture]:  # noqa: ANN401
    """Draws the dial."""

    def draw(angle_deg: float, seed: int = 0) -> GreyPicture:
        return paint(lambda canvas: (canvas.dial(range(135, 406, 27)), canvas.hand(hand(), angle_deg)), seed=seed)

    return draw


@pytest.fixture(scope="module")
def reader(pressure: Callable[..., GreyPicture], reader_for: Callable[..., PanelReader]) -> PanelReader:
    """Its reader, tuned to a flight in which the needle never leaves the scale."""
    return reader_for([GAUGE], pressure(214.0, 1), [pressure(140.0 + 17 * step, 20 + step) for step in range(16)])


@pytest.mark.parametrize("angle_deg", [115.0, 118.0, 124.0, 131.0, 135.0, 405.0, 411.0, 418.0, 421.0])
def test_needle_on_its_stop_is_read_there(
    reader: PanelReader, pressure: Callable[..., GreyPicture], angle_deg: float
) -> None:
    """From stop to stop, and a little more, a needle is read; its value goes on along the last two marks."""
    reading = reader.read(pressure(angle_deg, 3)).readings["oil_psi"]
    scale = Scale.of(GAUGE["scale"])
    slope = 50 / 135 if angle_deg < 200 else 150 / 135
    value = (angle_deg - 135) * slope if angle_deg < 200 else 200 + (angle_deg - 405) * slope

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.25)
    assert scale.values_at(np.array([reading.angle_deg]))[0] == pytest.approx(value, abs=0.3)


@pytest.mark.parametrize("angle_deg", [66.0, 76.0, 90.0, 100.0, 108.0])
def test_needle_beyond_its_stops_is_missing(
    reader: PanelReader, pressure: Callable[..., GreyPicture], angle_deg: float
) -> None:
    """Where no needle can be there is none: the nearest stop is not taken for it."""
    assert reader.read(pressure(angle_deg, 3)).readings["oil_psi"].status is Status.MISSING


def test_without_stops_the_rest_is_missing(
    pressure: Callable[..., GreyPicture], reader_for: Callable[..., PanelReader]
) -> None:
    """A needle at rest outside the sweep has no value unless the panel says that it can be there."""
    without = {key: value for key, value in GAUGE.items() if key != "stops"}
    reader = reader_for([without], pressure(214.0, 1))

    assert reader.read(pressure(118.0, 3)).readings["oil_psi"].status is Status.MISSING


@pytest.mark.parametrize("angle_deg", [150.0, 222.2, 271.0, 333.3, 399.0])
def test_needle_between_the_stops_is_read_as_ever(
    reader: PanelReader, pressure: Callable[..., GreyPicture], angle_deg: float
) -> None:
    """Stops take nothing from the reading of a needle on its scale."""
    reading = reader.read(pressure(angle_deg, 4)).readings["oil_psi"]

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.2)
