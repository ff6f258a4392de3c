"""The search gives the scores of `over_face`, however many needles and frames are searched together."""

from __future__ import annotations

import numpy as np
import pytest

from decoder.needle_template import NeedleTemplate
from decoder.over_face import face_moments, partial_normxcorr
from decoder.searching import COARSE_STEP, Search, Sought, collected, dealt, thinned

GAUGES = [(301, 21), (304, 21), (253, 12)]
HEIGHTS = [3, 31, 33, 45]


def noise(rng: np.random.Generator, shape: tuple[int, ...], low: float, high: float) -> np.ndarray:
    """Numbers between two, any as likely as another."""
    return rng.uniform(low, high, shape).astype(np.float32)


def sought(rng: np.random.Generator, gauge: int, height: int) -> Sought:
    """A needle that looks like nothing at all."""
    shape = (height, GAUGES[gauge][1])
    layers = {name: noise(rng, shape, 0, 1) for name in ("pixels", "transparency", "trust")}
    template = NeedleTemplate(**layers, light=noise(rng, shape, 0, 200), step_deg=0.5)
    return Sought(template, noise(rng, GAUGES[gauge], 0, 255), gauge)


@pytest.fixture(scope="module")
def needles() -> list[Sought]:
    """Of several heights on gauges of several lengths and widths."""
    rng = np.random.default_rng(1)
    return [sought(rng, gauge, height) for gauge in range(len(GAUGES)) for height in HEIGHTS]


@pytest.fixture(scope="module")
def frames() -> list[list[np.ndarray]]:
    """By frame the unwrapped gauges; more than are searched at once."""
    rng = np.random.default_rng(2)
    return [[noise(rng, shape, 0, 255) for shape in GAUGES] for _ in range(60)]


def test_rows_are_dealt_out_and_collected_again() -> None:
    """Every third row and column comes back; what was added are copies of the last row."""
    gauge = np.random.default_rng(3).uniform(size=(40, 7))
    rows = collected(dealt(gauge))
    np.testing.assert_array_equal(rows[:14], gauge[::COARSE_STEP, ::COARSE_STEP])
    np.testing.assert_array_equal(rows[14:], gauge[[-1], ::COARSE_STEP])


def test_scores_are_those_of_the_thinned_gauge(needles: list[Sought], frames: list[list[np.ndarray]]) -> None:
    """Each needle's scores are what `over_face` has of every third row and column, on the rows that it names."""
    search = Search(needles)
    coarse = search.coarse([dealt(gauge)[None] for gauge in frames[0]])[0]
    for needle, place, scores in zip(needles, search.places, coarse, strict=True):
        thin, face = (image[::COARSE_STEP, ::COARSE_STEP] for image in (frames[0][needle.gauge], needle.face))
        expected = partial_normxcorr(thin, face, face_moments(face, thinned(needle.template)))
        assert place.count == len(expected)
        # where a few pixels leave next to nothing beside the face, single precision tells that less exactly
        few = needle.template.rows == min(HEIGHTS)
        np.testing.assert_allclose(scores[: place.count], expected, atol=5e-3 if few else 1e-4)
        assert not scores[place.count :].any()


def test_frames_do_not_change_each_other(needles: list[Sought], frames: list[list[np.ndarray]]) -> None:
    """To the last bit a frame's scores are those that it has alone."""
    search = Search(needles)
    together = search.coarse([np.stack([dealt(frame[gauge]) for frame in frames]) for gauge in range(len(GAUGES))])
    for frame, scores in zip(frames, together, strict=True):
        np.testing.assert_array_equal(search.coarse([dealt(gauge)[None] for gauge in frame])[0], scores)
