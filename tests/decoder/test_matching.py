"""Matching: the fraction of a row, and an honest spread of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.alignment import IDENTITY
from decoder.frame_placer import UnwrappedFrame
from decoder.matching import Matcher
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Reading, Status
from decoder.searching import Search, Sought
from decoder.unwrapping import UnwrappedGauge, Unwrapper, rows_at

Draw = Callable[..., GreyPicture]
RENDERS = 200


@pytest.fixture(scope="module")
def matcher(reader: PanelReader) -> Matcher:
    """A matcher of the drawn speed needle."""
    return Matcher(reader.tuning.templates["speed_kt"], reader.grids[0].pixels_per_sample, reader.tuning.faces[0])


def unwrapped(reader: PanelReader, frame: GreyPicture) -> list[UnwrappedGauge]:
    """The gauges of a frame that is known to lie exactly where the panel picture does."""
    return Unwrapper(reader.grids).unwrap(frame, IDENTITY)


def scores_of(matcher: Matcher, strip: UnwrappedGauge) -> np.ndarray:
    """The search's scores of one needle."""
    (scores,) = Search([Sought(matcher.template, matcher._face, 0)]).scores([strip])
    return scores


def speed(reader: PanelReader, frame: GreyPicture) -> Reading:
    """The speed in a frame that is known to lie exactly where the panel picture does."""
    seen = UnwrappedFrame(IDENTITY, unwrapped(reader, frame), [True] * len(reader.grids))
    return reader.read_unwrapped(seen).readings["speed_kt"]


@pytest.mark.parametrize("noise", [4.0, 8.0, 16.0])
@pytest.mark.parametrize("angle_deg", [200.0, 263.3, 390.4])
def test_sigma_is_the_spread_of_the_error(reader: PanelReader, draw: Draw, noise: float, angle_deg: float) -> None:
    """Over two hundred noisy frames the readings spread as widely as they say, within a factor of two."""
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


def test_sigma_grows_with_the_noise(reader: PanelReader, draw: Draw) -> None:
    """The noisier the frame, the less sure the reading says it is, and the lower its score."""
    hands = {"speed_kt": 263.3, "al_lb": 160.0, "fr_lb": 300.0}
    readings = [speed(reader, draw(hands, noise=noise, seed=72)) for noise in (0.0, 6.0, 12.0, 24.0)]
    sigmas, scores = ([getattr(reading, name) for reading in readings] for name in ("sigma_deg", "score"))

    assert sigmas == sorted(sigmas)
    assert scores == sorted(scores, reverse=True)


@given(row=st.floats(60.0, 540.0))
def test_shifted_template_is_found_to_a_hundredth_of_a_row(matcher: Matcher, row: float) -> None:
    """A needle put on its own face at any fractional row is found there."""
    strip = over_face(matcher, row)
    scores = scores_of(matcher, strip)
    match = matcher.best(strip, scores, np.ones(len(strip), bool), scores)

    assert match.row == pytest.approx(row, abs=0.05)
    assert match.score > 0.99


def over_face(matcher: Matcher, row: float) -> UnwrappedGauge:
    """The face with the matcher's needle at a fractional row."""
    face = matcher._face
    template = matcher.template
    rows = np.arange(len(face)) - row + matcher.axis
    inside = ((rows >= 0) & (rows <= template.rows - 1))[:, None]
    light = np.where(inside, rows_at(template.light, rows), 0.0)
    through = np.where(inside, rows_at(template.transparency, rows), 1.0)
    return (light + through * face).astype(np.float32)


def test_rows_that_are_not_allowed_are_never_matched(matcher: Matcher) -> None:
    """Where the needle may not be it is not looked for, however well it matches there."""
    strip = over_face(matcher, 300.0)
    allowed = np.ones(len(strip), bool)
    allowed[280:320] = False
    scores = scores_of(matcher, strip)
    match = matcher.best(strip, scores, allowed, scores)

    assert not 280 <= round(match.row) < 320
    assert match.score < 0.8


def test_nothing_allowed_is_no_match(matcher: Matcher) -> None:
    """With no row to look at there is no match, its score 0 and its spread without end."""
    strip = over_face(matcher, 300.0)
    scores = scores_of(matcher, strip)
    match = matcher.best(strip, scores, np.zeros(len(strip), bool), scores)

    assert (match.score, match.sigma_rows) == (0.0, float("inf"))


def test_bare_face_scores_nothing(matcher: Matcher) -> None:
    """The dial without a needle is explained by itself: no row scores."""
    assert np.abs(scores_of(matcher, matcher._face)).max() < 0.5


@pytest.mark.parametrize("grey", [0.0, 128.0, 255.0])
def test_flat_gauge_scores_zero(matcher: Matcher, grey: float) -> None:
    """A flat gauge scores 0 on every row and gives no NaN."""
    flat = np.full_like(matcher._face, grey)

    assert scores_of(matcher, flat).tolist() == [0.0] * len(flat)


@given(gain=st.floats(0.2, 3.0), offset=st.floats(-50.0, 100.0))
def test_light_does_not_move_a_match(matcher: Matcher, gain: float, offset: float) -> None:
    """Gain and offset change neither the row nor the score."""
    strip = over_face(matcher, 251.3)
    lit = (gain * strip + offset).astype(np.float32)
    everywhere = np.ones(len(strip), bool)
    plain = matcher.best(strip, scores_of(matcher, strip), everywhere, scores_of(matcher, strip))
    other = matcher.best(lit, scores_of(matcher, lit), everywhere, scores_of(matcher, lit))

    assert other.row == pytest.approx(plain.row, abs=0.01)
    assert other.score == pytest.approx(plain.score, abs=0.01)


def test_scores_are_within_one(reader: PanelReader, draw: Draw, matcher: Matcher) -> None:
    """Every row of any gauge has a finite score of at most 1."""
    for noise in (0.0, 80.0):
        strip = unwrapped(reader, draw({"speed_kt": 140.0}, noise=noise, seed=73))[0]
        scores = scores_of(matcher, strip)
        assert np.isfinite(scores).all()
        assert np.abs(scores).max() <= 1.0
