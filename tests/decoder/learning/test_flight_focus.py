"""A flight that is less sharp than its panel picture: by how much is measured, and dials are known as they appear."""

from __future__ import annotations

import math

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import PolarGrid
from decoder.instruments.panel_reader import PanelReader, read_picture, unwrapped
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight
from decoder.learning.flight_focus import as_sharp_as_frames, blurs_px2
from tests.decoder.instruments.dials import Canvas, Hand, apart, finished, paint, reader_for

SHARP_PX = 0.5
THIN = Hand(tip=66.0, root_half=0.9, tip_half=0.5, level=200.0)
AT_DEG = 220.0
DIAL = {
    "name": "dial",
    "radius": [16, 72],
    "sweep": [170, 370],
    "unit": "norm",
    "scale": [[180, 0], [360, 1]],
    "needles": [{"name": "hand_norm", "template": {"at": AT_DEG, "span": 16}}],
}
TRUTH_DEG = [185.0 + 10.7 * frame for frame in range(16)]


def draw(at_deg: float, blur_px: float = 0.0, seed: int = 0, noise: float = 3.0) -> GreyPicture:
    """A thin needle over a dial full of fine print, out of focus by so much more than the panel picture."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 5))
        rng = np.random.default_rng(4)
        for numeral in range(24):
            half, radius_px = rng.uniform(0.6, 3.0), rng.uniform(30.0, 50.0)
            canvas.bar(numeral * 15 + rng.uniform(-4, 4), (radius_px, radius_px + 3.5), (half, half), 190.0)
        canvas.hand(THIN, at_deg)

    return paint(what, blur=math.hypot(SHARP_PX, blur_px), seed=seed, noise=noise)


@pytest.fixture(scope="module")
def reader() -> PanelReader:
    """A reader that knows the panel picture alone."""
    return reader_for([DIAL], draw(AT_DEG))


@pytest.mark.parametrize("noise", [1.0, 8.0])
@pytest.mark.parametrize("blur_px", [0.0, 0.8, 1.5, 2.5])
def test_blur_of_frames_is_measured_whatever_their_noise(reader: PanelReader, blur_px: float, noise: float) -> None:
    """Though the needle has moved in all of them."""
    frames = [draw(at_deg, blur_px, 1 + seed, noise) for seed, at_deg in enumerate(TRUTH_DEG)]
    (grid,), (own,) = reader.grids, reader.own_gauges
    assert isinstance(grid, PolarGrid)
    found = blurs_px2(grid, own, [sample.gauges[0] for sample in unwrapped(reader, frames)])

    assert len(found) == len(frames)
    assert float(np.median(found)) == pytest.approx(blur_px**2, abs=0.1 + 0.2 * blur_px**2)


@pytest.mark.parametrize("beside_px", [1.0, 2.0])
def test_a_dial_beside_its_place_is_not_blurred(reader: PanelReader, beside_px: float) -> None:
    """It is as sharp there."""
    (grid,), (own,) = reader.grids, reader.own_gauges
    assert isinstance(grid, PolarGrid)
    beside = np.roll(draw(AT_DEG, seed=1), round(beside_px), axis=1)
    beside[20:60, 194:234] = draw(AT_DEG, seed=1)[20:60, 194:234]  # the anchor stays
    found = blurs_px2(grid, own, [sample.gauges[0] for sample in unwrapped(reader, [beside] * 3)])

    assert max(found) < 0.2 * beside_px**2


def test_a_needle_of_which_a_blur_leaves_nothing_is_known_as_drawn() -> None:
    """A small dial beside a big one that is out of focus ends no decode."""
    small = {
        **DIAL,
        "name": "small",
        "centre": [210.0, 150.0],
        "radius": [4, 14],
        "needles": [{"name": "small_norm", "template": {"at": AT_DEG, "span": 40}}],
    }

    def both(at_deg: float, blur_px: float = 0.0, seed: int = 0) -> GreyPicture:
        dial = Canvas()
        dial.disc((210.0, 150.0), 16.0, 35.0)
        dial.hand(Hand(tip=13.0, root_half=0.8, tip_half=0.8, level=70.0, centre=(210.0, 150.0)), at_deg)
        corner = finished(dial, noise=1.0, blur=math.hypot(SHARP_PX, blur_px), quality=95, seed=seed)[130:175, 185:235]
        picture = draw(at_deg, blur_px, seed, 1.0)
        picture[130:175, 185:235] = corner
        return picture

    frames = [both(at_deg, 2.5, 1 + seed) for seed, at_deg in enumerate(TRUTH_DEG)]
    fitted = fit_to_flight(reader_for([DIAL, small], both(AT_DEG)), lambda _: frames).reader

    assert fitted.source.blur_px == pytest.approx(2.5, abs=0.5)
    assert all(read_picture(fitted, frame).readings["hand_norm"].status is Status.READ for frame in frames[2:-2])


def test_dials_stay_as_drawn_where_frames_are_as_sharp_or_sharper(reader: PanelReader) -> None:
    """Noise is no blur, and a panel picture out of focus is not blurred further."""
    frames = [draw(at_deg, 0.0, 1 + seed) for seed, at_deg in enumerate(TRUTH_DEG)]
    soft = reader_for([DIAL], draw(AT_DEG, 1.5))

    assert as_sharp_as_frames(reader, unwrapped(reader, frames)) is reader
    assert as_sharp_as_frames(soft, unwrapped(soft, frames)) is soft
    assert as_sharp_as_frames(reader, []) is reader


@pytest.mark.parametrize("blur_px", [2.0, 3.0])
def test_a_thin_needle_is_read_out_of_focus(reader: PanelReader, blur_px: float) -> None:
    """As cut from the sharp panel picture, it is found in none of the frames."""
    frames = [draw(at_deg, blur_px, 1 + seed) for seed, at_deg in enumerate(TRUTH_DEG)]
    fitted = fit_to_flight(reader, lambda _: frames).reader
    found = [read_picture(fitted, frame).readings["hand_norm"] for frame in frames]

    assert sum(reading.status is Status.READ for reading in found) >= 14
    for reading, at_deg in zip(found, TRUTH_DEG, strict=True):
        assert reading.status is Status.MISSING or apart(reading.angle_deg, at_deg) < 0.5
