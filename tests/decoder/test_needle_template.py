"""Needle templates: where a needle is in its template, and how wide it is."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.needle_template import OUTLINE_LEVEL, TOUCH_LEVEL, NeedleTemplate, odd_rows
from decoder.panel_reader import PanelReader

Read = Callable[..., PanelReader]


@given(span_deg=st.floats(2.0, 90.0), step_deg=st.sampled_from([0.25, 0.5]))
def test_rows_are_odd_and_cover_the_span(span_deg: float, step_deg: float) -> None:
    """There is a middle row, and the rows cover the span to a step."""
    rows = odd_rows(span_deg, step_deg)

    assert rows % 2 == 1
    assert (rows - 1) * step_deg == pytest.approx(span_deg, abs=step_deg + 1e-9)


@pytest.fixture
def template(reader: PanelReader) -> NeedleTemplate:
    """The drawn speed needle."""
    return reader.tuning.templates["speed_kt"]


def test_outline_is_the_needle(template: NeedleTemplate) -> None:
    """The outline is symmetric about the axis, widest at the bottom, and ends with the needle's tip."""
    outline = template.outline
    axis = template.rows // 2

    assert outline[axis, :17].all()
    assert not outline[:, 21:].any()
    assert np.abs(outline.astype(int) - outline[::-1].astype(int)).sum() <= 4
    assert outline[:, 0].sum() > outline[:, 13].sum()


def test_touched_place_holds_the_outline(template: NeedleTemplate) -> None:
    """The faded edge lies around the outline, never inside it."""
    outline, touched = template.place(OUTLINE_LEVEL), template.place(TOUCH_LEVEL)

    assert (touched | ~outline).all()
    assert touched.sum() > outline.sum()


def test_half_width_is_the_drawn_one(template: NeedleTemplate) -> None:
    """At the innermost radius of 20 pixels the needle is drawn 1.9 pixels to each side: 5.5 degrees."""
    assert template.half_width_deg == pytest.approx(5.5, abs=1.0)


def test_dark_needle_has_the_same_outline(reader: PanelReader, template: NeedleTemplate) -> None:
    """A dark needle on a light dial is where a light one on a dark dial would be."""
    dark = NeedleTemplate(
        255 - template.pixels,
        template.light,
        template.transparency,
        template.trust,
        template.step_deg,
    )

    assert np.array_equal(dark.outline, template.outline)
    assert reader.grids[0].step_deg == template.step_deg


def test_what_is_made_of_a_template_is_made_once_and_stays_behind(template: NeedleTemplate) -> None:
    """It is no part of the template: another process is told the same bytes before and after."""
    before = pickle.dumps(template)

    made = [template.once(_fresh_list) for _ in range(2)]

    assert made[0] is made[1]
    assert template.touched.any()
    assert pickle.dumps(template) == before


def _fresh_list(template: NeedleTemplate) -> list[int]:
    return [template.rows]
