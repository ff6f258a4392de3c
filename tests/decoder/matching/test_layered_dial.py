"""Dials drawn with needles over them: where these point, and what a drawing leaves of what is seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.matching.layered_dial import LayeredDial
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats

TURN, COLUMNS = 120, 6


def template(columns: int = COLUMNS, level: float = 100.0) -> NeedleTemplate:
    """A bar three rows wide, nothing beside it."""
    light, through = np.zeros((9, columns), np.float32), np.ones((9, columns), np.float32)
    light[3:6, -COLUMNS:], through[3:6, -COLUMNS:] = level, 0.0
    return NeedleTemplate(light, light, through, np.ones_like(light), 3.0)


def face() -> Floats:
    """Marks all round."""
    return np.random.default_rng(2).uniform(20.0, 60.0, (TURN, COLUMNS)).astype(np.float32)


@given(row=st.integers(-TURN, 2 * TURN))
def test_needle_is_drawn_where_it_points_all_the_way_round(row: int) -> None:
    """Three rows of it cover the face, across the seam as well; all else is the face."""
    (picture,) = LayeredDial(face(), [template()]).drawn(np.array([[float(row)]]))
    covered = (row + np.array([-1, 0, 1])) % TURN

    assert (picture[covered] == 100.0).all()
    assert (np.delete(picture, covered, axis=0) == np.delete(face(), covered, axis=0)).all()


@given(row=st.floats(0.0, TURN - 1.0))
def test_thin_dial_is_every_third_row_and_column_of_the_whole(row: float) -> None:
    """So coarse drawings are to be had without the fine ones."""
    rows = np.array([[row]])
    thin, whole = (LayeredDial(face(), [template()], step).drawn(rows) for step in (3, 1))

    assert thin == pytest.approx(whole[:, ::3, ::3], abs=1e-3)
