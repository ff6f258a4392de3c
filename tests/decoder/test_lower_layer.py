"""The lower of two needles in windows of the upper one: its own rows, and what is seen of it through that one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.arrays import Floats
from decoder.lower_layer import MIN_COVER, LowerNeedle
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import rows_at

ROWS, COLUMNS = 11, 4


def needle(seed: int) -> NeedleTemplate:
    """A template with any light, and transparencies between nothing and all."""
    rng = np.random.default_rng(seed)
    light, transparency, ones = (
        values.astype(np.float32)
        for values in (rng.normal(40.0, 30.0, (ROWS, COLUMNS)), rng.random((ROWS, COLUMNS)), np.ones((ROWS, COLUMNS)))
    )
    return NeedleTemplate(light, light, transparency, ones, step_deg=0.5)


@given(
    axes=st.lists(st.one_of(st.floats(-60.0, 60.0), st.integers(-60, 60)), min_size=1, max_size=6),
    height=st.integers(1, 15),
)
def test_layer_is_the_template_s_rows(axes: list[float], height: int) -> None:
    """Wherever its axis lies, on whole rows and far beyond the window, too; it covers nothing beyond its ends."""
    template, rows = needle(7), np.array(axes, float)
    layer = LowerNeedle(template, height).at(np.stack([rows, rows]))

    assert layer.cover.shape == layer.colour.shape == (2, len(axes), height, COLUMNS)
    assert (layer.cover[0] == layer.cover[1]).all()
    for axis, cover, colour in zip(rows, layer.cover[0], layer.colour[0], strict=True):
        own = np.arange(height) - axis + (ROWS - 1) / 2
        inside = (own >= 0) & (own <= ROWS - 1)
        light, transparency = (rows_at(each, own) for each in (template.light, template.transparency))
        assert np.allclose(cover[inside], 1.0 - transparency[inside], rtol=0.0, atol=2e-6)
        assert not cover[~inside].any()
        assert np.allclose(colour * np.maximum(cover, MIN_COVER), light, rtol=0.0, atol=1e-4)


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
    opaque = transparency <= MIN_COVER

    assert opaque.any()
    assert np.allclose(seen[opaque], (transparency * face)[opaque], rtol=0.0, atol=1e-3)
    assert np.allclose(seen[~opaque], (transparency * (light + part * face))[~opaque], rtol=0.0, atol=1e-3)
