"""Reading through glare: soft light does not shift a reading, and what it saturates is not guessed."""

from __future__ import annotations

import numpy as np
import pytest

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import Unwrapper
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.registration.frame_placer import UnwrappedFrame
from tests.decoder.cockpit import draw

CENTRE = (85.4, 110.7)  # of the drawn speed dial
SIGMA_PX = 30.0


def under_glare(reader: PanelReader, frame: GreyPicture, at: tuple[float, float], levels: float) -> Reading:
    """The speed in a frame with a soft reflection of so many grey levels at a place."""
    y, x = np.mgrid[0 : frame.shape[0], 0 : frame.shape[1]]
    light = levels * np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2 * SIGMA_PX**2))
    lit = np.clip(np.rint(frame + light), 0, 255).astype(np.uint8)
    gauges = Unwrapper(reader.grids).unwrap(lit, IDENTITY)  # the anchor may be drowned as well: that is another test
    return reader.read_unwrapped([UnwrappedFrame(IDENTITY, gauges, [True] * len(gauges))])[0].readings["speed_kt"]


def on_needle(angle_deg: float, radius_px: float) -> tuple[float, float]:
    """A place on the needle."""
    angle = np.radians(angle_deg)
    return CENTRE[0] + radius_px * float(np.cos(angle)), CENTRE[1] + radius_px * float(np.sin(angle))


@pytest.mark.parametrize("angle_deg", [160.0, 271.8, 381.5])
@pytest.mark.parametrize("radius_px", [10.0, 40.0, 75.0])
@pytest.mark.parametrize("levels", [60.0, 140.0])
def test_soft_light_does_not_move_the_reading(
    reader: PanelReader, angle_deg: float, radius_px: float, levels: float
) -> None:
    """Wherever along the needle a reflection lies that leaves it in sight, the reading stays put."""
    frame = draw({"speed_kt": angle_deg, "al_lb": 160.0, "fr_lb": 300.0}, noise=2.0, seed=int(angle_deg))
    reading = under_glare(reader, frame, on_needle(angle_deg, radius_px), levels)

    assert reading.status in (Status.READ, Status.EDGE)
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.2)
    assert abs(reading.angle_deg - angle_deg) < 5 * max(reading.sigma_deg, 0.04)


@pytest.mark.parametrize("angle_deg", [160.0, 271.8, 381.5])
@pytest.mark.parametrize("levels", [180.0, 260.0, 800.0])
def test_what_a_glare_drowns_is_not_guessed(reader: PanelReader, angle_deg: float, levels: float) -> None:
    """The more of the needle is saturated, the fewer readings; each is right or uncertain."""
    frame = draw({"speed_kt": angle_deg, "al_lb": 160.0, "fr_lb": 300.0}, noise=2.0, seed=int(angle_deg))
    reading = under_glare(reader, frame, on_needle(angle_deg, 35.0), levels)

    if reading.status is not Status.MISSING:
        assert reading.angle_deg == pytest.approx(angle_deg, abs=max(0.3, 4 * reading.sigma_deg))


def test_a_needle_that_is_gone_is_missing(reader: PanelReader) -> None:
    """A dial without a needle under any reflection has no reading."""
    bare = draw({"al_lb": 160.0, "fr_lb": 300.0}, noise=2.0, seed=5)
    readings = [
        under_glare(reader, bare, on_needle(angle_deg, radius_px), levels)
        for angle_deg in (130.0, 220.0, 310.0)
        for radius_px in (0.0, 40.0)
        for levels in (60.0, 140.0, 300.0)
    ]

    assert {reading.status for reading in readings} == {Status.MISSING}


def test_a_needle_partly_drowned_is_an_edge(reader: PanelReader) -> None:
    """A reading that rests on a part of the needle says so."""
    frame = draw({"speed_kt": 271.8, "al_lb": 160.0, "fr_lb": 300.0}, noise=2.0, seed=6)
    readings = [
        under_glare(reader, frame, on_needle(271.8, radius_px), levels)
        for radius_px in (20.0, 60.0)
        for levels in (200.0, 240.0, 280.0)
    ]
    statuses = {reading.status for reading in readings}

    assert Status.EDGE in statuses
    assert Status.HIDDEN not in statuses
