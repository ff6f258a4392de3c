"""Least squares in windows: the fraction of a row, and an honest spread of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import UnwrappedGauge, Unwrapper
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import Reading, Status
from decoder.matching.needle_fit import Fits, Settled, WindowFitter, settle
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import blocks_of, rows_at
from decoder.matching.thresholds import MAX_PEAK_ROWS
from decoder.panel.arrays import Floats, Indices
from decoder.registration.frame_placer import UnwrappedFrame
from tests.decoder.cockpit import draw

RENDERS = 100


def unwrapped(reader: PanelReader, frame: GreyPicture) -> list[UnwrappedGauge]:
    """The gauges of a frame that is known to lie exactly where the panel picture does."""
    return Unwrapper(reader.grids).unwrap(frame, IDENTITY)


def speed(reader: PanelReader, frame: GreyPicture) -> Reading:
    """The speed in a frame that is known to lie exactly where the panel picture does."""
    seen = UnwrappedFrame(IDENTITY, unwrapped(reader, frame), [True] * len(reader.grids))
    return reader.read_unwrapped([seen])[0].readings["speed_kt"]


@pytest.mark.slow
@pytest.mark.parametrize(("angle_deg", "noise"), [(200.0, 4.0), (263.3, 16.0), (390.4, 8.0)])
def test_sigma_is_the_spread_of_the_error(reader: PanelReader, noise: float, angle_deg: float) -> None:
    """Over a hundred noisy frames the spread of readings is their sigma, within a factor of two."""
    clean = draw({"speed_kt": angle_deg, "al_lb": 160.0, "fr_lb": 300.0}).astype(np.float64)
    rng = np.random.default_rng(71)
    readings = []
    for _ in range(RENDERS):
        noisy = np.clip(np.rint(clean + rng.normal(0.0, noise, clean.shape)), 0, 255).astype(np.uint8)
        readings.append(speed(reader, noisy))
    spread_deg = float(np.std([reading.angle_deg for reading in readings]))
    sigma_deg = float(np.mean([reading.sigma_deg for reading in readings]))

    assert {reading.status for reading in readings} == {Status.READ}
    assert sigma_deg / 2 < spread_deg < sigma_deg * 2


@pytest.fixture(scope="module")
def needle(reader: PanelReader) -> NeedleTemplate:
    """The drawn speed needle."""
    return reader.appearance.templates["speed_kt"]


@pytest.fixture(scope="module")
def face(reader: PanelReader) -> UnwrappedGauge:
    """The speed dial without it."""
    return reader.appearance.faces[0]


def over_face(needle: NeedleTemplate, face: UnwrappedGauge, row: float) -> UnwrappedGauge:
    """The face with the needle at a fractional row."""
    rows = np.arange(len(face)) - row + (needle.rows - 1) // 2
    inside = ((rows >= 0) & (rows <= needle.rows - 1))[:, None]
    light = np.where(inside, rows_at(needle.light, rows), 0.0)
    through = np.where(inside, rows_at(needle.transparency, rows), 1.0)
    return (light + through * face).astype(np.float32)


def settled(needle: NeedleTemplate, face: UnwrappedGauge, strip: UnwrappedGauge, place: float) -> Settled:
    """The row at which a window settles that starts at a place of a gauge."""
    axis, fitter = (needle.rows - 1) // 2, WindowFitter([needle], [0.5])

    def fit(_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
        windows, faces = (blocks_of(each, needle.rows)[rows - axis] for each in (strip, face))
        return fitter.fit(windows, faces, guess_rows)

    return settle(fit, np.array([place]), (axis, len(face) - axis - 1), MAX_PEAK_ROWS)


@given(row=st.floats(60.0, 540.0), off=st.floats(-2.5, 2.5))
def test_shifted_needle_is_found_to_a_twentieth_of_a_row(
    needle: NeedleTemplate, face: UnwrappedGauge, row: float, off: float
) -> None:
    """A needle drawn on its own face at any fractional row is found there, from any start nearby."""
    found = settled(needle, face, over_face(needle, face, row), row + off)

    assert found.is_settled.all()
    assert found.row[0] == pytest.approx(row, abs=0.05)
    assert found.score[0] > 0.99


@settings(max_examples=30)
@given(gain=st.floats(0.2, 3.0), offset=st.floats(-50.0, 100.0))
def test_light_does_not_move_a_needle(needle: NeedleTemplate, face: UnwrappedGauge, gain: float, offset: float) -> None:
    """Gain and offset change neither the row nor the score."""
    strip = over_face(needle, face, 251.3)
    plain, lit = (settled(needle, face, each.astype(np.float32), 251.0) for each in (strip, gain * strip + offset))

    assert lit.row[0] == pytest.approx(plain.row[0], abs=0.01)
    assert lit.score[0] == pytest.approx(plain.score[0], abs=0.01)


def test_a_light_that_changes_over_the_window_is_taken_out(needle: NeedleTemplate, face: UnwrappedGauge) -> None:
    """A gradient of light shifts a needle fitted with constant light, but not one fitted with a gradient."""
    axis, row = (needle.rows - 1) // 2, 251
    window = blocks_of(over_face(needle, face, row), needle.rows)[[row - axis]]
    down = np.linspace(-1, 1, needle.rows).repeat(face.shape[1]).astype(np.float32)
    behind = blocks_of(face, needle.rows)[[row - axis]]
    lights = np.stack([np.ones_like(down), down])
    plain = WindowFitter([needle], [0.5]).fit(window + 60 * down, behind, np.zeros(1))
    lit = WindowFitter([needle], [0.5], lights).fit(window + 60 * down, behind, np.zeros(1))

    assert abs(lit.fraction[0]) < 0.02 < abs(plain.fraction[0])
    assert lit.score[0] > 0.99 > plain.score[0]
