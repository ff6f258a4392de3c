"""Templates: a needle's width, a dial without it, and dials drawn with needles over them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import tune
from decoder.matching.faces import learn_face
from decoder.matching.layered_dial import DialComparison, LayeredDial
from decoder.matching.needle_layer import first_layer, without_others
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats
from decoder.registration.thresholds import NOISE_LEVELS
from tests.decoder.cockpit import angles_of, draw, reader_of


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


SHAPE = (3, 4)


@given(st.integers(1, 20), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_the_face_is_the_median_of_what_no_needle_covers(frames: int, covered: float, seed: int) -> None:
    """Pixel by pixel, to the bit; from two different values, or fewer, nothing is learned."""
    rng = np.random.default_rng(seed)
    strips = rng.integers(0, 30, (frames, *SHAPE)).astype(np.float32)
    places = rng.random((frames, *SHAPE)) < covered
    fallback = np.full(SHAPE, 200.0, np.float32)

    face = learn_face(list(strips), [np.flatnonzero(place) for place in places], fallback)

    for at in np.ndindex(*SHAPE):
        seen = strips[:, *at][~places[:, *at]]
        tells = len(seen) > 2 or (len(seen) == 2 and np.ptp(seen) <= 2 * NOISE_LEVELS)
        assert face[at] == (np.median(seen) if tells else 200.0)


@pytest.mark.parametrize("other_rows", [-14.0, 10.0])
def test_needle_beside_another_one_in_its_picture_is_cut_as_if_alone(other_rows: float) -> None:
    """What is nearer to the other's axis is taken from the other half of the needle, and is not trusted."""
    rows = np.arange(-12, 13)[:, None] * np.ones((1, 5))
    plain = np.full(5, 40.0, np.float32)
    alone = np.where(np.abs(rows) <= 4, 220.0, plain).astype(np.float32)
    both = np.where(np.abs(rows - other_rows) <= 3, 180.0, alone).astype(np.float32)

    cut = without_others(first_layer(both, plain, 0.5), [other_rows], plain)
    between = without_others(first_layer(both, plain, 0.5), [other_rows, -other_rows], plain)
    its = np.sign(other_rows) * rows > abs(other_rows) / 2

    assert (cut.pixels == alone).all()
    assert (between.pixels == alone).all()
    assert (cut.trust == ~its).all()
    assert (without_others(first_layer(alone, plain, 0.5), [], plain).trust == 1.0).all()


def test_columns_that_a_needle_fills_are_its_own() -> None:
    """Next to its hub it has no edges in its template: what is there is no dial."""
    pixels = np.full((21, 6), 40.0, np.float32)
    pixels[8:13] = pixels[:, :2] = 220.0
    template = first_layer(pixels, np.full(6, 40.0, np.float32), 0.5)

    assert template.touched[:, :2].all()
    assert not template.touched[:7, 2:].any()
    assert template.half_width_deg < 2.0


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
    """So coarse drawings need no fine ones."""
    rows = np.array([[row]])
    thin, whole = (LayeredDial(face(), [template()], step).drawn(rows) for step in (3, 1))

    assert thin == pytest.approx(whole[:, ::3, ::3], abs=1e-3)


RADII_PX = np.linspace(10.0, 80.0, COLUMNS)


def dark() -> Floats:
    """A face without marks."""
    return np.full((TURN, COLUMNS), 20.0, np.float32)


@given(gain=st.floats(0.3, 3.0), offset=st.floats(-50.0, 50.0))
def test_a_dial_drawn_right_explains_all_in_any_light(gain: float, offset: float) -> None:
    """And any other place of the needle is so much worse that it is no rival."""
    compared = DialComparison(face(), RADII_PX, [template()])
    drawn = LayeredDial(face(), [template()]).drawn(np.array([[30.0], [60.0]]))
    seen = np.float32(gain) * drawn[0] + np.float32(offset)

    right, wrong = compared.unexplained(seen, drawn)
    assert right == pytest.approx(0.0, abs=1e-2)
    assert wrong > 1.0
    assert compared.lit(seen, drawn[:1])[0] == pytest.approx(seen, abs=0.1)
    assert compared.times_worse(seen, drawn)[0] > 10.0


def test_a_dim_needle_counts_though_the_face_is_wrong_below_a_bright_one() -> None:
    """What a drawing cannot explain anywhere does not decide where the dim needle is."""
    bright, dim = template(level=220.0), template(level=50.0)
    dial = LayeredDial(dark(), [bright, dim])
    seen = dial.drawn(np.array([[30.0, 70.0]]))[0]
    unknown = dark()
    unknown[34:40] = 220.0  # where the bright needle was in the panel picture
    compared = DialComparison(unknown, RADII_PX, [bright, dim])
    right, covering = LayeredDial(unknown, [bright, dim]).drawn(np.array([[30.0, 70.0], [30.0, 36.0]]))

    square = [float(((each - seen) ** 2).mean()) for each in (right, covering)]
    assert square[1] < square[0]
    left = compared.unexplained(seen, np.stack([right, covering]))
    assert left[0] < left[1]


def test_pixels_near_the_centre_count_by_their_area() -> None:
    """The same wrong levels in the innermost and the outermost column, as far from the centre as these lie."""
    compared = DialComparison(dark(), RADII_PX, [template()])
    drawn = np.stack([face(), face()])
    drawn[0, 40:60, 0] += 10.0
    drawn[1, 40:60, -1] += 10.0

    inner, outer = compared.unexplained(face(), drawn)
    assert outer / inner == pytest.approx(RADII_PX[-1] / RADII_PX[0], rel=0.1)


def needle_of(edges: Floats, level: float = 200.0) -> NeedleTemplate:
    """A needle between two edges (C, 2), in rows from the template's axis, sharp to a fraction of a row."""
    rows = np.arange(41.0)[:, None] - 20.0
    covers = np.clip(np.minimum(rows - edges[:, 0], edges[:, 1] - rows) + 0.5, 0.0, 1.0).astype(np.float32)
    pixels = 20.0 + (level - 20.0) * covers
    return NeedleTemplate(pixels, pixels, 1.0 - covers, np.ones_like(pixels), 0.5)


@given(st.floats(-1.5, 1.5), st.floats(3.0, 6.0), st.floats(1.0, 3.0), st.sampled_from([0.0, 200.0]))
def test_middle_of_a_needle_with_like_edges_is_known_to_a_fraction_of_a_row(
    beside_rows: float, root_half: float, tip_half: float, level: float
) -> None:
    """Bright or dark, tapered or not."""
    half = np.linspace(root_half + 3.0, tip_half + 3.0, 24)
    edges = beside_rows + np.stack([-half, half], axis=1)

    assert needle_of(edges, level).beside_deg == pytest.approx(0.5 * beside_rows, abs=0.06)


@given(st.floats(0.5, 3.0), st.floats(6.0, 12.0))
def test_middle_of_a_needle_with_one_straight_edge_counts_for_less(tip: float, root: float) -> None:
    """Its middle line is elsewhere at each radius, and says little about where it points to."""
    far = np.linspace(root, tip, 24)
    edges = np.stack([np.full(24, -0.5), far], axis=1)

    assert needle_of(edges).beside_deg <= 0.5 * float(np.median(edges.mean(axis=1)))


@given(st.floats(1.5, 6.0))
def test_what_lies_beside_the_axis_altogether_counts_as_half_of_its_width(beside_rows: float) -> None:
    """Whoever drew it may have meant something else by it, but is not surer of that than of a smaller miss."""
    edges = np.tile([beside_rows - 3.0, beside_rows + 3.0], (24, 1))

    assert needle_of(edges).beside_deg == pytest.approx(0.5 * min(beside_rows, 3.0), abs=0.06)
