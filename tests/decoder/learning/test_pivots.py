"""Pivots: found from needles to some hundredths of a pixel, and unchanged if the panel is right."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.panel_pictures import panel_from_file
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.needle_lines import Tilt, pivot_of_tilts
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.registration.pivot import PRIOR_PX, UNKNOWN, Pivot
from tests.decoder.cockpit import BETWEEN_MARKS_DEG, angles_of, between_marks, draw, reader_of
from tests.programs import FIXTURES

offsets_px = st.floats(-2.0, 2.0)


def moved(x_px: float, y_px: float) -> Callable[[dict[str, Any]], None]:
    """A panel whose speed gauge is drawn off its pivot."""

    def change(content: dict[str, Any]) -> None:
        between_marks(content)
        centre = content["gauges"][0]["centre"]
        content["gauges"][0]["centre"] = [centre[0] + x_px, centre[1] + y_px]

    return change


def standing(angle_deg: float) -> list[GreyPicture]:
    """The sample of a flight in which the speed never changes."""
    hands = ({**angles_of(seed), "speed_kt": angle_deg} for seed in range(900, 916))
    return [draw(each, noise=2.0, seed=seed, ticks=True) for seed, each in enumerate(hands, 900)]


def reader_moved(x_px: float, y_px: float) -> PanelReader:
    """A reader of a panel whose speed gauge is drawn off its pivot."""
    return reader_of(moved(x_px, y_px), panel=draw(BETWEEN_MARKS_DEG, ticks=True))


def frames() -> list[GreyPicture]:
    """A flight's sample."""
    return [draw(angles_of(seed), noise=2.0, seed=seed, ticks=True) for seed in range(700, 716)]


def tilts_about(x_px: float, y_px: float, angles_deg: list[float], own_px: float, noise_px: float = 0.0) -> list[Tilt]:
    """The tilts of a needle that turns about a point off the centre of the unwrapped dial."""
    rng = np.random.default_rng(7)
    return [
        Tilt(
            "a",
            angle,
            own_px
            - math.sin(math.radians(angle)) * x_px
            + math.cos(math.radians(angle)) * y_px
            + rng.normal(0, 1) * noise_px,
            max(noise_px, 0.01),
        )
        for angle in angles_deg
    ]


@given(offsets_px, offsets_px, st.floats(-1.0, 1.0))
def test_pivot_follows_from_tilts_all_round(x_px: float, y_px: float, own_px: float) -> None:
    """A needle seen all round gives the pivot whatever its own tilt is."""
    pivot = pivot_of_tilts(tilts_about(x_px, y_px, list(range(0, 360, 30)), own_px))

    assert pivot.offset_px == pytest.approx((x_px, y_px), abs=0.01)


def test_one_wild_tilt_moves_nothing() -> None:
    """A glare that turns one needle by pixels is outvoted."""
    tilts = tilts_about(0.4, -0.3, list(range(0, 360, 24)), 0.2, noise_px=0.02)
    spoilt = [*tilts[:-1], Tilt("a", tilts[-1].angle_deg, 5.0, 0.02)]

    assert pivot_of_tilts(spoilt).offset_px == pytest.approx((0.4, -0.3), abs=0.05)


def test_needle_that_stands_still_tells_nothing() -> None:
    """Without a turn there is no pivot, and the panel's is kept."""
    pivot = pivot_of_tilts(tilts_about(1.5, 1.5, [200.0] * 16, 0.3, noise_px=0.02))

    assert not pivot.is_certain
    assert np.sqrt(np.diag(pivot.covariance_px2)).max() > 0.4


def test_needle_in_two_places_moves_no_pivot() -> None:
    """An error in one place, such as from a mark always hidden by the needle, would be taken for the pivot."""
    tilts = tilts_about(0.0, 3.0, [200.0] * 14 + [208.0] * 3, 0.1, noise_px=0.01)
    pivot = pivot_of_tilts(tilts)

    assert not pivot.is_certain
    assert np.hypot(*pivot.offset_px) < PRIOR_PX
    nobody_told, told = (each.sigma_deg(np.array([208.0]), 200.0, 50.0) for each in (UNKNOWN, pivot))
    assert told > 0.9 * nobody_told


def test_needle_that_stands_still_is_told_by_where_the_panel_picture_has_it() -> None:
    """A right pivot is known to be right without a turn in flight, which otherwise leaves half a pixel's doubt."""
    reader = reader_moved(0.0, 0.0)
    still = standing(305.0)
    fitted = fit_to_flight(reader, lambda _: still)
    (sigma_deg,) = fitted.sigma_deg("speed_kt", np.array([305.0]))

    assert sigma_deg < 0.6  # half a pixel is 0.8
    for sample in still[:4]:
        reading = read_picture(fitted.reader, sample).readings["speed_kt"]
        assert abs(reading.angle_deg - 305.0) < 3 * math.hypot(sigma_deg, reading.sigma_deg)


def test_too_few_tilts_tell_nothing() -> None:
    """Four frames are no evidence."""
    assert pivot_of_tilts(tilts_about(1.0, 1.0, [0.0, 90.0, 180.0, 270.0], 0.0)) is UNKNOWN


def test_tilts_that_scatter_less_than_they_claim_tell_more() -> None:
    """Their noise is then less than the residuals of their pixels suggest."""
    angles = list(range(150, 330, 12))
    claims = [Tilt("a", angle, 0.1 + noise, 0.1) for angle, noise in zip(angles, (0.01, -0.01) * 8, strict=False)]
    honest = [Tilt("a", angle, 0.1 + 10 * noise, 0.1) for angle, noise in zip(angles, (0.01, -0.01) * 8, strict=False)]

    ratio = np.diag(pivot_of_tilts(claims).covariance_px2) / np.diag(pivot_of_tilts(honest).covariance_px2)
    assert (ratio < 0.3).all()


def test_spread_of_the_pivot_is_what_it_claims() -> None:
    """Over many noisy flights the offsets scatter as their covariance says."""
    rng = np.random.default_rng(3)
    chi2 = []
    for _ in range(150):
        angles = rng.uniform(150, 330, 16)
        tilts = [Tilt("a", float(angle), float(rng.normal(0.1, 0.06)), 0.05) for angle in angles]
        pivot = pivot_of_tilts(tilts)
        offset = np.array(pivot.offset_px)
        chi2.append(offset @ np.linalg.solve(pivot.covariance_px2, offset))

    assert 1.5 < np.mean(chi2) < 3.2  # two degrees of freedom


def test_panel_with_a_pivot_beside_the_true_one_is_put_right() -> None:
    """The gauge is unwrapped around its pivot, and reads like a correct one; a correct one is left alone."""
    fitted = fit_to_flight(reader_moved(0.8, -0.5), lambda _: frames())

    assert fitted.moved_px["speed"] == pytest.approx((-0.8, 0.5), abs=0.05)
    assert "fuel" not in fitted.moved_px
    for seed in range(800, 808):
        truth = angles_of(seed)
        reading = read_picture(fitted.reader, draw(truth, ticks=True)).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.angle_deg == pytest.approx(truth["speed_kt"], abs=0.1)


def test_pivot_that_was_not_found_is_told() -> None:
    """A gauge whose needles do not turn about the last round's pivot is named, and its needle is less certain."""
    reader = reader_moved(-3.2, 2.4)
    found, not_found = (fit_to_flight(reader, lambda _: frames(), rounds=rounds) for rounds in (8, 1))
    doubts_px = [fitted.uncertainties["speed_kt"].pivot.sigma_px for fitted in (found, not_found)]

    assert found.unsettled == found.findings["fuel"] == ()
    assert found.findings["speed"][0].startswith("turns 3.2 px right of and 2.4 px above the drawn centre, corrected;")
    assert not_found.unsettled == ("speed",)
    assert not_found.findings["speed"][0].startswith("turns about another point than the drawn centre, but")
    assert doubts_px[1] > 2 * doubts_px[0]


def test_doubt_about_the_pivot_grows_away_from_the_needles_zero() -> None:
    """A wrong pivot does no harm where the template was cut, but does on the other side of the dial."""
    reader = reader_moved(0.0, 0.0)
    still = standing(225.0)
    fitted = fit_to_flight(reader, lambda _: still)
    near, far = fitted.sigma_deg("speed_kt", np.array([225.0, 405.0]))

    assert near < 0.6
    assert far > 1.2 * near


def test_frames_of_another_shape_are_fitted_to_as_any_others() -> None:
    """In a cropped picture the panel is where it was, and no pivot moves."""
    reader = reader_from_panel(panel_from_file(FIXTURES / "panel.yaml"), Method.NORMXCORR)
    cut = np.ascontiguousarray(reader.source.picture[:-200])
    fitted = fit_to_flight(reader, lambda _: [cut] * 6)

    own = reader.source.picture.shape[1], reader.source.picture.shape[0] - 200
    zoom = fitted.reader.aligner.optics.zoom(None, own)
    assert np.allclose(zoom @ fitted.reader.placement.usual.matrix, np.eye(3), atol=0.01)
    assert fitted.sampled == 6
    assert not fitted.moved_px


def test_pivot_that_settled_in_small_steps_is_less_certain() -> None:
    """After a first step of a third, the rest is known with three times its error; after a full one, with none."""
    covariance = np.diag([0.0009, 0.0004])
    slowly = Pivot((0.0, -0.05), covariance).settled((0.0, -0.2), (0.0, -0.55))
    at_once = Pivot((0.01, 0.0), covariance).settled((0.4, 0.0), (0.38, 0.0))

    assert slowly.covariance_px2 == pytest.approx(9.0 * covariance)
    assert slowly.offset_px == (0.0, -0.05)
    assert at_once.covariance_px2 == pytest.approx(covariance)
