"""Dials drawn with needles over them: where these point, and what a drawing leaves of what is seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.matching.layered_dial import LayeredDial, lit_as, times_worse, unexplained
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


def test_tail_is_drawn_half_a_turn_on() -> None:
    """A template with columns across the centre has its tail there, from the rim inwards."""
    bare = template(2 * COLUMNS)
    bare.light[3:6, :COLUMNS], bare.transparency[3:6, :COLUMNS] = np.arange(COLUMNS), 0.0
    (picture,) = LayeredDial(face(), [bare]).drawn(np.array([[10.0]]))

    assert (picture[10] == 100.0).all()
    assert picture[10 + TURN // 2] == pytest.approx(np.arange(COLUMNS)[::-1])


def test_upper_needle_lies_over_the_lower_one() -> None:
    """The last of the templates; what is below shows through by what it leaves bare."""
    dial = LayeredDial(face(), [template(level=100.0), template(level=200.0)])
    rows = np.array([[30.0, 31.0]])
    (picture,), (bare,) = dial.drawn(rows), dial.left_bare(rows, [1])

    assert picture[29:33, 0].tolist() == [100.0, 200.0, 200.0, 200.0]
    assert bare[29:33, 0].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert (dial.drawn(rows, [0])[0, 29:32] == 100.0).all()


@given(row=st.floats(0.0, TURN - 1.0))
def test_thin_dial_is_every_third_row_and_column_of_the_whole(row: float) -> None:
    """So coarse drawings are to be had without the fine ones."""
    rows = np.array([[row]])
    thin, whole = (LayeredDial(face(), [template()], step).drawn(rows) for step in (3, 1))

    assert thin == pytest.approx(whole[:, ::3, ::3], abs=1e-3)


def test_drawing_is_brought_into_the_light_of_what_is_seen() -> None:
    """Gain and offset are the frame's: what differs by them alone leaves nothing unexplained."""
    drawn = LayeredDial(face(), [template()]).drawn(np.array([[50.0], [80.0]]))
    seen = 0.5 * drawn[0] + 30.0
    lit = lit_as(seen, drawn)

    assert lit[0] == pytest.approx(seen, abs=1e-3)
    assert unexplained(seen, lit)[0] < 1e-6
    assert unexplained(seen, lit)[1] > 10.0


def test_wrong_drawing_is_worse_and_the_same_one_is_not() -> None:
    """By as much as it leaves where the two differ; what lies elsewhere on the dial does not count."""
    right, wrong = LayeredDial(face(), [template()]).drawn(np.array([[50.0], [80.0]]))
    seen = right + np.random.default_rng(4).normal(0.0, 2.0, right.shape).astype(np.float32)
    seen[100:110] = 255.0

    assert times_worse(seen, right, np.stack([right, wrong])) == pytest.approx([1.0, 300.0], rel=0.5)
    assert times_worse(seen, wrong, right[None])[0] < 0.01
