"""Correlation along the rows: planted targets are found, flat ones are not, and light does not matter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from decoder.matching.correlation import normxcorr, turned_correlation, xcorr
from decoder.matching.needle_search import peaks_of

Image = NDArray[np.float32]


def random_image(seed: int, rows: int = 60, columns: int = 12) -> Image:
    """Random grey levels."""
    return np.random.default_rng(seed).uniform(0, 255, (rows, columns)).astype(np.float32)


def even(template: Image) -> Image:
    """Equal weights for all of a template."""
    return np.ones_like(template)


@pytest.mark.parametrize("rows", [(7, 31), (0, 51), (20, 33)])
def test_two_planted_targets_are_both_found(rows: tuple[int, int]) -> None:
    """In noise, only the two targets score 1, and a target in negative has the lowest score."""
    template, image = random_image(4, rows=9), random_image(5)
    for row in rows:
        image[row : row + 9] = template
    image[42:51] = 255 - template

    scores = normxcorr(image, template, even(template))

    assert sorted(np.argsort(scores)[-2:].tolist()) == sorted(rows)
    assert scores[list(rows)] == pytest.approx([1.0, 1.0], abs=1e-4)
    assert scores.argmin() == 42
    assert scores.min() == pytest.approx(-1.0, abs=1e-4)


@given(seed=st.integers(0, 10_000), gain=st.floats(0.1, 10.0), offset=st.floats(-200.0, 200.0))
def test_light_does_not_change_the_score(seed: int, gain: float, offset: float) -> None:
    """The normalized correlation is the same at any gain and offset of the picture, or of the template."""
    image, template = random_image(seed), random_image(seed + 1, rows=9)
    plain = normxcorr(image, template, even(template))
    lit_image, lit_template = (gain * each + offset for each in (image, template))

    assert normxcorr(lit_image, template, even(template)) == pytest.approx(plain, abs=2e-3)
    assert normxcorr(image, lit_template, even(template)) == pytest.approx(plain, abs=2e-3)


@given(
    seed=st.integers(0, 10_000),
    contrast=st.floats(0.0, 255.0),
    level=st.floats(0.0, 255.0),
    weighted=st.booleans(),
)
def test_score_is_a_number_within_one(seed: int, contrast: float, level: float, *, weighted: bool) -> None:
    """Whatever the picture and the weights, every score is finite and at most 1 in size."""
    image = (random_image(seed) / 255 * contrast + level).astype(np.float32)
    template = image[11:20].copy()
    weights = random_image(seed + 1, rows=9) / 255 if weighted else even(template)

    scores = normxcorr(image, template, weights)

    assert np.isfinite(scores).all()
    assert np.abs(scores).max() <= 1.0


FAINT = (100.0 + 1e-3 * random_image(11) / 255).astype(np.float32)
NO_CONTRAST: dict[str, tuple[Image, Image, float]] = {
    "black template": (random_image(10), np.zeros((9, 12), np.float32), 1.0),
    "template of rounding": (random_image(11), FAINT[:9], 1.0),
    "gauge of rounding": (FAINT, random_image(12, rows=9), 1.0),
    "no weight": (random_image(16), random_image(15, rows=9), 0.0),
}


@pytest.mark.parametrize(("image", "template", "weight"), NO_CONTRAST.values(), ids=NO_CONTRAST)
def test_nothing_to_match_scores_zero_everywhere(image: Image, template: Image, weight: float) -> None:
    """Without contrast, except rounding, or without weights: where OpenCV gives 1, or NaN would result."""
    assert normxcorr(image, template, weight * even(template)).tolist() == [0.0] * 52


def test_pixels_without_weight_do_not_count() -> None:
    """A target whose unweighted half shows something else still scores 1."""
    template, image = random_image(13, rows=9), random_image(14)
    weights = even(template)
    weights[:, 6:] = 0.0
    image[30:39, :6] = template[:, :6]

    assert normxcorr(image, template, weights)[30] == pytest.approx(1.0, abs=1e-4)


def test_plain_correlation_prefers_light_to_likeness() -> None:
    """Plain correlation is highest on a bright patch that normxcorr does not mistake for the target."""
    template, image = random_image(19, rows=9), random_image(20)
    image[10:19], image[40:49] = template, 255.0

    assert xcorr(image, template).argmax() == 40
    assert normxcorr(image, template, even(template)).argmax() == 10


@given(top=st.floats(-0.49, 0.49), bend=st.floats(0.1, 10.0), height=st.floats(-5.0, 5.0))
def test_peak_of_a_parabola_is_exact(top: float, bend: float, height: float) -> None:
    """Three samples of a parabola give its vertex to the fraction of a row."""
    scores = height - bend * (np.arange(7) - 3 - top) ** 2

    index, place = peaks_of(scores, np.ones(7, bool))
    assert index == 3
    assert place == pytest.approx(3 + top, abs=1e-6)


@pytest.mark.parametrize("scores", [[3.0, 2.0, 1.0], [1.0, 2.0, 3.0], [-np.inf, 3.0, 1.0], [1.0, 1.0, 1.0]])
def test_peak_is_never_further_than_half_a_row_from_the_highest_score(scores: list[float]) -> None:
    """Also at an end, beside an excluded row, and with equal scores."""
    index, place = peaks_of(np.array(scores), np.ones(3, bool))

    assert scores[int(index)] == max(scores)
    assert abs(place - index) <= 0.5


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_turn_that_brings_nothing_that_changes_together_matches_nothing(noise: float) -> None:
    """A needle that moves a little over print that stands still has turned by that, not by the print's steps."""
    rng, places = np.random.default_rng(4), (90, 96, 104, 109, 115)
    pictures = np.full((5, 360, 16), 30.0, np.float32)
    pictures[:, ::10] = 200.0
    for picture, at in zip(pictures, places, strict=True):
        picture[at : at + 4] = 190.0
    pictures += rng.normal(0.0, noise, pictures.shape).astype(np.float32)

    scores = turned_correlation(pictures, 3.0)

    assert np.abs(scores[~np.eye(5, dtype=bool), 60:300]).max() < 0.5
    for one in range(4):
        assert abs(int(scores[one, one + 1].argmax()) - (places[one + 1] - places[one])) <= 3
        assert scores[one, one + 1].max() > 0.9
