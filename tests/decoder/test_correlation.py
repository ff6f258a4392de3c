"""Correlation along the rows: planted targets are found, flat ones are not, and light does not matter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from decoder.correlation import normxcorr, parabola_peak, sliding_sums, xcorr

Image = NDArray[np.float32]


def random_image(seed: int, rows: int = 60, columns: int = 12) -> Image:
    """Grey levels of nothing in particular."""
    return np.random.default_rng(seed).uniform(0, 255, (rows, columns)).astype(np.float32)


def even(template: Image) -> Image:
    """Equal weights for all of a template."""
    return np.ones_like(template)


def test_sliding_sums_are_the_sums_they_say() -> None:
    """Each sum is that of the products of the kernel and the window that starts on its row."""
    image, kernel = random_image(1), random_image(2, rows=9)
    sums = sliding_sums(image, kernel)

    expected = [(image[row : row + 9].astype(float) * kernel).sum() for row in range(52)]

    assert sums == pytest.approx(expected, rel=1e-5)


def test_kernel_of_the_images_own_size_gives_one_sum() -> None:
    """A template as high as the gauge has a single place."""
    image = random_image(3)

    assert sliding_sums(image, image) == pytest.approx([(image.astype(float) ** 2).sum()], rel=1e-5)


@pytest.mark.parametrize("rows", [(7, 31), (0, 51), (20, 33)])
def test_two_planted_targets_are_both_found(rows: tuple[int, int]) -> None:
    """In noise, the two places that score 1 are the two at which the target was planted."""
    template = random_image(4, rows=9)
    image = random_image(5)
    for row in rows:
        image[row : row + 9] = template

    scores = normxcorr(image, template, even(template))

    assert sorted(np.argsort(scores)[-2:].tolist()) == sorted(rows)
    assert scores[list(rows)] == pytest.approx([1.0, 1.0], abs=1e-4)


def test_inverted_target_scores_minus_one() -> None:
    """A dark needle where a light one is wanted is the worst match there is."""
    template = random_image(6, rows=9)
    image = random_image(7)
    image[20:29] = 255 - template

    scores = normxcorr(image, template, even(template))

    assert scores[20] == pytest.approx(-1.0, abs=1e-4)
    assert scores.argmin() == 20


@given(seed=st.integers(0, 10_000), gain=st.floats(0.1, 10.0), offset=st.floats(-200.0, 200.0))
def test_light_does_not_change_the_score(seed: int, gain: float, offset: float) -> None:
    """The normalized correlation is the same at any gain and offset of the picture."""
    image, template = random_image(seed), random_image(seed + 1, rows=9)
    brighter = (image * gain + offset).astype(np.float32)

    there = normxcorr(brighter, template, even(template))

    assert there == pytest.approx(normxcorr(image, template, even(template)), abs=2e-3)


@given(seed=st.integers(0, 10_000), gain=st.floats(0.1, 10.0), offset=st.floats(-200.0, 200.0))
def test_light_of_the_template_does_not_change_the_score(seed: int, gain: float, offset: float) -> None:
    """The normalized correlation is the same at any gain and offset of the template."""
    image, template = random_image(seed), random_image(seed + 1, rows=9)
    brighter = (template * gain + offset).astype(np.float32)

    there = normxcorr(image, brighter, even(brighter))

    assert there == pytest.approx(normxcorr(image, template, even(template)), abs=2e-3)


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


def test_flat_window_scores_zero() -> None:
    """A flat window scores 0, not 1 and not NaN."""
    image, template = random_image(8), random_image(9, rows=9)
    image[15:30] = 77.0

    scores = normxcorr(image, template, even(template))

    assert scores[15:22].tolist() == [0.0] * 7
    assert (scores[:6] != 0).all()


@pytest.mark.parametrize("level", [0.0, 255.0])
def test_flat_template_scores_zero_everywhere(level: float) -> None:
    """A flat template scores 0 everywhere, where OpenCV says 1."""
    template = np.full((9, 12), level, np.float32)

    scores = normxcorr(random_image(10), template, even(template))

    assert scores.tolist() == [0.0] * 52


@pytest.mark.parametrize("contrast", [1e-9, 1e-3])
def test_almost_no_contrast_is_no_contrast(contrast: float) -> None:
    """A gauge that differs from grey by rounding alone scores 0 and gives no NaN."""
    image = (100.0 + contrast * random_image(11) / 255).astype(np.float32)
    template = random_image(12, rows=9)

    assert normxcorr(image, template, even(template)).tolist() == [0.0] * 52
    assert normxcorr(random_image(11), image[:9], even(template)).tolist() == [0.0] * 52


def test_pixels_without_weight_do_not_count() -> None:
    """A target whose unweighted half shows something else still scores 1."""
    template, image = random_image(13, rows=9), random_image(14)
    weights = even(template)
    weights[:, 6:] = 0.0
    image[30:39, :6] = template[:, :6]

    assert normxcorr(image, template, weights)[30] == pytest.approx(1.0, abs=1e-4)


def test_template_without_any_weight_scores_zero() -> None:
    """With nothing to trust there is no match."""
    template = random_image(15, rows=9)

    assert normxcorr(random_image(16), template, np.zeros_like(template)).tolist() == [0.0] * 52


def test_template_longer_than_the_gauge_is_refused() -> None:
    """Switched arguments raise rather than read beyond the gauge."""
    image, template = random_image(17), random_image(18, rows=9)

    with pytest.raises(ValueError, match=r".+"):
        normxcorr(template, image, even(image))


def test_plain_correlation_prefers_light_to_likeness() -> None:
    """Plain correlation is highest on a bright patch that normxcorr does not mistake for the target."""
    template, image = random_image(19, rows=9), random_image(20)
    image[10:19], image[40:49] = template, 255.0

    assert xcorr(image, template).argmax() == 40
    assert normxcorr(image, template, even(template)).argmax() == 10


@given(top=st.floats(-0.5, 0.5), bend=st.floats(0.1, 10.0), height=st.floats(-5.0, 5.0))
def test_peak_of_a_parabola_is_exact(top: float, bend: float, height: float) -> None:
    """Three samples of a parabola give its top to the fraction of a row."""
    scores = height - bend * (np.arange(7) - 3 - top) ** 2

    assert parabola_peak(scores, 3) == pytest.approx(3 + top, abs=1e-6)


@pytest.mark.parametrize(
    ("scores", "index"),
    [
        ([3.0, 2.0, 1.0], 0),
        ([1.0, 2.0, 3.0], 2),
        ([-np.inf, 3.0, 1.0], 1),
        ([1.0, 1.0, 1.0], 1),
        ([np.nan, 1.0, 0.0], 1),
    ],
    ids=["first", "last", "beside a ruled-out row", "flat", "beside a NaN"],
)
def test_peak_without_two_lower_neighbours_stays_on_its_row(scores: list[float], index: int) -> None:
    """Where no parabola can be laid the whole row is the answer."""
    assert parabola_peak(np.array(scores), index) == float(index)
