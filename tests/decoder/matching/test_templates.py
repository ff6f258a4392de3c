"""What templates say: how wide a needle is, what is seen beside and through it, and what a dial shows without it."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import tune
from decoder.matching.faces import learn_face
from decoder.matching.lower_layer import LowerNeedle
from decoder.matching.needle_layer import first_layer
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MIN_CONTRAST_PART, NOISE_LEVELS
from decoder.panel.arrays import Floats
from tests.decoder.cockpit import angles_of, draw, reader_of


@pytest.fixture
def template(reader: PanelReader) -> NeedleTemplate:
    """The drawn speed needle."""
    return reader.appearance.templates["speed_kt"]


def test_what_is_made_of_a_template_is_made_once_and_stays_behind(template: NeedleTemplate) -> None:
    """It is no part of the template: another process is told the same bytes before and after."""
    before = pickle.dumps(template)

    made = [template.once(_fresh_list) for _ in range(2)]

    assert made[0] is made[1]
    assert template.touched.any()
    assert pickle.dumps(template) == before


def _fresh_list(template: NeedleTemplate) -> list[int]:
    return [template.rows]


def too_narrow(content: dict[str, Any]) -> None:
    """A panel whose template is narrower than the needle's root."""
    gauge = content["gauges"][0]
    gauge["radius"] = [6, 52]
    gauge["needles"][0]["template"]["span"] = 8


def test_needle_wider_than_its_template_near_the_pivot_is_read_all_the_same() -> None:
    """Where the needle fills the template it has no edges; the rest of it is enough."""
    tuned = tune(reader_of(too_narrow), [draw(angles_of(seed), noise=2.0, seed=seed) for seed in range(16)])
    for seed in range(20, 28):
        truth = angles_of(seed)
        reading = read_picture(tuned, draw(truth)).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.score > 0.97
        assert reading.angle_deg == pytest.approx(truth["speed_kt"], abs=0.1)


def test_columns_without_an_edge_are_not_trusted() -> None:
    """A column that the needle fills says nothing; one whose needle ends on one side at least does."""
    plain = np.full(3, 40.0, np.float32)
    pixels = np.full((21, 3), 40.0, np.float32)
    pixels[:, 0] = 200.0  # filled
    pixels[:12, 1] = 200.0  # reaches over one end
    pixels[8:13, 2] = 200.0  # stands free
    layer = first_layer(pixels, plain, 0.5)

    assert layer.trust.max(axis=0).tolist() == [0.0, 1.0, 1.0]
    assert first_layer(pixels[:, :1], plain[:1], 0.5).trust.min() == 1.0  # with no edge anywhere it is as good as any


ROWS, COLUMNS = 11, 4


def needle(seed: int) -> NeedleTemplate:
    """A template with any light, and transparencies between nothing and all."""
    rng = np.random.default_rng(seed)
    light, transparency, ones = (
        values.astype(np.float32)
        for values in (rng.normal(40.0, 30.0, (ROWS, COLUMNS)), rng.random((ROWS, COLUMNS)), np.ones((ROWS, COLUMNS)))
    )
    return NeedleTemplate(light, light, transparency, ones, step_deg=0.5)


@pytest.mark.parametrize("apart_rows", [-7, -2, 0, 1, 4])
def test_what_is_seen_through_a_needle_is_what_lies_behind_it(apart_rows: int) -> None:
    """By its transparency; through next to none of it the face alone is seen."""
    rng = np.random.default_rng(5)
    face: Floats = rng.uniform(20.0, 200.0, (1, ROWS, COLUMNS)).astype(np.float32)
    transparency: Floats = rng.random((1, ROWS, COLUMNS)).astype(np.float32)
    # on whole rows nothing is interpolated, so nothing covers more than all
    lower = LowerNeedle(needle(3), ROWS).at(np.array([(ROWS - 1) / 2 + apart_rows]))
    light, part = lower.behind(transparency)
    seen = lower.through(transparency, face)
    opaque = transparency <= MIN_CONTRAST_PART

    assert opaque.any()
    assert np.allclose(seen[opaque], (transparency * face)[opaque], rtol=0.0, atol=1e-3)
    assert np.allclose(seen[~opaque], (transparency * (light + part * face))[~opaque], rtol=0.0, atol=1e-3)


SHAPE = (3, 4)


@given(st.integers(1, 20), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_the_face_is_the_median_of_what_no_needle_covers(frames: int, covered: float, seed: int) -> None:
    """Pixel by pixel, to the bit; of two values that differ, or fewer, nothing is learned."""
    rng = np.random.default_rng(seed)
    strips = rng.integers(0, 30, (frames, *SHAPE)).astype(np.float32)
    places = rng.random((frames, *SHAPE)) < covered
    fallback = np.full(SHAPE, 200.0, np.float32)

    face = learn_face(list(strips), [np.flatnonzero(place) for place in places], fallback)

    for at in np.ndindex(*SHAPE):
        seen = strips[:, *at][~places[:, *at]]
        tells = len(seen) > 2 or (len(seen) == 2 and np.ptp(seen) <= 2 * NOISE_LEVELS)
        assert face[at] == (np.median(seen) if tells else 200.0)
