"""Clicks snap to their targets: rings, marks and needles of dials drawn from formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.optics import Optics
from decoder.panel.errors import PictureError
from decoder.setup.dial_edges import (
    Freedom,
    Ring,
    begun,
    centre_doubt_px,
    circle_through,
    fitted_ring,
    mark_angle_deg,
    refined,
)
from decoder.setup.drawn_plane import DrawnPlane, Planes
from decoder.setup.proposals import Dial, Pictures, needle_at, proposed, turning_px
from decoder.setup.thresholds import MAX_MOVE_PX

Picture = NDArray[np.uint8]
CENTRE, RING_PX = (80.3, 79.6), 50.0
TICKS_DEG = range(0, 360, 15)
FLAT, HERE = DrawnPlane.square_on((0.0, 0.0)), DrawnPlane.square_on(CENTRE)


Lean = tuple[tuple[float, float], tuple[float, float]]
UPRIGHT: Lean = ((1.0, 0.0), (0.0, 1.0))
LEANING: Lean = ((0.85, 0.03), (0.03, 0.99))
"""As from about thirty degrees beside its axis."""
STEEP: Lean = ((0.55, 0.0), (0.0, 1.0))
BLIND = Planes(Optics((160, 160)), None)


def inside(distance_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """1 within an outline, 0 outside, blurred like a lens does."""
    return 0.5 * (1.0 - np.tanh(distance_px / 0.9))


def dial(
    needle_deg: float | None, *, dark: float = 30.0, light: float = 210.0, seed: int = 0, lean: Lean = UPRIGHT
) -> Picture:
    """A dial with marks that end at `RING_PX`, and a needle with two tones; `lean` is how it leans."""
    y, x = np.mgrid[0:160, 0:160].astype(np.float64)
    x, y = np.einsum("ij,jhw->ihw", np.linalg.inv(np.array(lean)), np.stack([x - CENTRE[0], y - CENTRE[1]]))
    radius = np.hypot(x, y)
    away = (np.degrees(np.arctan2(y, x)) + 7.5) % 15.0 - 7.5
    ticks = inside(np.abs(np.radians(away) * radius) - 1.2) * inside(radius - RING_PX) * inside(42.0 - radius)
    picture = dark + (light - dark) * ticks
    if needle_deg is not None:
        cos, sin = math.cos(math.radians(needle_deg)), math.sin(math.radians(needle_deg))
        along, across = x * cos + y * sin, y * cos - x * sin
        shape = inside(np.abs(across) - 4.0 + 3.0 * along / 46.0) * inside(along - 46.0) * inside(-along)
        tone = light + 0.35 * (dark - light) * inside(across)
        picture += (tone - picture) * shape
    noisy = picture + np.random.default_rng(seed).normal(0.0, 1.5, picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def around(angle_deg: float, radius_px: float, lean: Lean = UPRIGHT) -> tuple[float, float]:
    """A place on the dial."""
    angle = math.radians(angle_deg)
    x, y = np.array(lean) @ (radius_px * math.cos(angle), radius_px * math.sin(angle))
    return CENTRE[0] + float(x), CENTRE[1] + float(y)


@given(
    x=st.floats(-500, 5000), y=st.floats(-500, 5000), radius=st.floats(5, 2000), turn=st.floats(0, 360)
)  # fmt: skip
def test_circle_goes_through_its_points(x: float, y: float, radius: float, turn: float) -> None:
    """Three points of a circle give that circle."""
    places = [
        (x + radius * math.cos(math.radians(turn + step)), y + radius * math.sin(math.radians(turn + step)))
        for step in (0, 100, 230)
    ]
    rim = circle_through(FLAT, places)

    assert math.dist(rim.centre, (x, y)) < 1e-4
    assert rim.radius_px == pytest.approx(radius, abs=1e-4)


@pytest.mark.parametrize("places", [[(0, 0), (1, 1), (2, 2)], [(5, 5), (5, 5), (5, 5)], [(0, 0), (100, 0), (50, 0.5)]])
def test_points_on_a_line_are_no_circle(places: list[tuple[float, float]]) -> None:
    """Clicks that lie on a line are refused in a sentence."""
    with pytest.raises(PictureError, match="lie on a line"):
        circle_through(FLAT, places)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_three_clicks_on_a_leaning_dial_are_an_ellipse(seed: int) -> None:
    """Where the marks lie on an ellipse the rim is one, right to 0.2 pixels and a quarter of a degree."""
    chance = np.random.default_rng(seed)
    clicks = [
        (x + float(chance.uniform(-0.8, 0.8)), y + float(chance.uniform(-0.8, 0.8)))
        for x, y in (around(angle, RING_PX, LEANING) for angle in (150.0, 270.0, 390.0))
    ]
    rim = begun(dial(200.0, lean=LEANING), BLIND, clicks)

    assert rim.points is not None
    assert math.dist(rim.centre, CENTRE) < 0.2
    zero_deg, _ = rim.drawn.polar(around(0.0, RING_PX, LEANING))
    for angle_deg in range(15, 360, 15):
        found_deg, radius_px = rim.drawn.polar(around(angle_deg, RING_PX, LEANING))
        assert abs((found_deg - zero_deg - angle_deg + 180.0) % 360.0 - 180.0) < 0.25
        assert radius_px == pytest.approx(rim.radius_px, rel=0.005)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_three_clicks_on_an_upright_dial_are_a_circle(seed: int) -> None:
    """Seen square on it has no rim of its own, and a centre right to 0.1 pixels; on a flat picture it stays."""
    chance = np.random.default_rng(seed)
    clicks = [
        (x + float(chance.uniform(-0.8, 0.8)), y + float(chance.uniform(-0.8, 0.8)))
        for x, y in (around(angle, RING_PX) for angle in (150.0, 270.0, 390.0))
    ]
    rim, drawn = begun(dial(200.0), BLIND, clicks), circle_through(FLAT, clicks)

    assert rim.points is None
    assert rim.radius_px == pytest.approx(RING_PX, abs=0.2)
    assert math.dist(rim.centre, CENTRE) < 0.1
    assert fitted_ring(np.full((160, 160), 90, np.uint8), drawn, Freedom.CIRCLE) == drawn


def test_clicks_all_round_bend_a_circle_to_a_steep_ellipse() -> None:
    """From a circle that is far off, five clicks give the ellipse, however steep the view."""
    clicks = [around(angle, RING_PX, STEEP) for angle in (10.0, 80.0, 150.0, 225.0, 300.0)]
    rim = refined(dial(200.0, lean=STEEP), BLIND, Ring(HERE, RING_PX), clicks)

    assert math.dist(rim.centre, CENTRE) < 0.3
    long, short = np.ptp(np.array(rim.points), axis=0)[::-1]
    assert short / long == pytest.approx(0.55, abs=0.01)


def test_one_click_bends_the_rim_to_where_it_is() -> None:
    """A single click beside a rim moves it there, and as little as possible elsewhere."""
    flat = np.full((160, 160), 90, np.uint8)  # with no marks that it could be drawn to
    rim = refined(flat, BLIND, Ring(HERE, RING_PX), [around(0.0, RING_PX + 4.0)])

    assert rim.drawn.polar(around(0.0, RING_PX + 4.0))[1] == pytest.approx(rim.radius_px, abs=0.01)
    assert rim.drawn.polar(around(150.0, RING_PX))[1] == pytest.approx(rim.radius_px, abs=2.0)


@pytest.mark.parametrize(("dark", "light"), [(30.0, 210.0), (220.0, 40.0)])
@settings(max_examples=20, deadline=None)
@given(tick=st.sampled_from(TICKS_DEG), off_px=st.floats(-1.5, 1.5))
def test_mark_is_found_from_an_unsteady_click(dark: float, light: float, tick: int, off_px: float) -> None:
    """A click beside a mark, bright or dark, gives the mark's own angle to a seventh of a degree, or 0.12 pixels."""
    picture = dial(None, dark=dark, light=light)
    found = mark_angle_deg(picture, HERE, around(tick + math.degrees(off_px / 46.0), 46.0))

    assert abs((found - tick + 180.0) % 360.0 - 180.0) < 0.15


def test_click_where_no_mark_is_stands() -> None:
    """On an empty part of a dial the click's own angle is taken."""
    assert mark_angle_deg(np.full((160, 160), 90, np.uint8), HERE, around(33.0, 40.0)) == pytest.approx(33.0)


FULL = Dial(CENTRE, (14.0, 46.0), (0.0, 360.0))


@pytest.mark.parametrize("angle_deg", [20.0, 97.3, 188.8, 261.6])
def test_axis_of_a_needle_with_two_tones(angle_deg: float) -> None:
    """However a needle is lit, its axis is found to a seventh of a degree, from a guess a degree beside it."""
    frames = [(dial(angle_deg + turn, seed=number), IDENTITY) for number, turn in enumerate((40.0, 90.0, 170.0, 250.0))]
    own = dial(angle_deg, seed=9)

    for guess_deg in (angle_deg - 1.0, angle_deg, angle_deg + 1.0):
        assert needle_at(Pictures(own, frames), FULL, guess_deg).at_deg == pytest.approx(angle_deg, abs=0.15)


def test_axis_of_a_needle_that_never_moves() -> None:
    """Without a frame in which the needle is elsewhere, a plain dial is assumed."""
    frames = [(dial(127.3, seed=number), IDENTITY) for number in range(4)]

    assert needle_at(Pictures(dial(127.3, seed=9), frames), FULL, 126.8).at_deg == pytest.approx(127.3, abs=0.2)


def test_what_moves_is_proposed() -> None:
    """The needle of the panel picture is proposed, not the places where other frames have it; one at rest is not."""
    frames = [(dial(angle, seed=number), IDENTITY) for number, angle in enumerate((60.0, 61.0, 62.0, 63.0, 200.0))]
    (found,) = proposed(Pictures(dial(200.0, seed=9), frames), FULL)

    assert found.at_deg == pytest.approx(200.0, abs=0.15)
    assert 8.0 <= found.span_deg <= 40.0
    assert found.reach_px == pytest.approx(46.0, abs=2.5)
    assert proposed(Pictures(dial(60.0, seed=9), [(dial(60.0), IDENTITY)] * 5), FULL) == []


def test_print_in_another_light_is_no_needle() -> None:
    """A phone's exposure follows the light: print that is dimmer in most frames has not moved, only the needle has."""
    patch = np.hypot(*(np.mgrid[0:160, 0:160] - np.array([CENTRE[1] + 25.0, CENTRE[0]])[:, None, None])) < 12.0

    def frame(needle_deg: float, light: float, seed: int) -> Picture:
        printed = np.where(patch, 210, dial(needle_deg, seed=seed))
        return (printed * light).astype(np.uint8)

    frames = [(frame(20.0 + 9.0 * number, 0.6, number), IDENTITY) for number in range(5)]
    (found,) = proposed(Pictures(frame(200.0, 1.0, 9), frames), FULL)

    assert found.at_deg == pytest.approx(200.0, abs=0.15)


def test_how_far_a_card_reaches_is_seen() -> None:
    """The turning part is told from the fixed ones in and around it, to a few pixels, with a centre a pixel off."""
    spots = np.random.default_rng(3).uniform(40.0, 220.0, (90, 45)).astype(np.uint8)  # by angle and radius

    def card(turn_deg: float) -> Picture:
        y, x = np.mgrid[0:160, 0:160].astype(np.float64)
        radius, angle = np.hypot(x - CENTRE[0], y - CENTRE[1]), np.degrees(np.arctan2(y - CENTRE[1], x - CENTRE[0]))
        turned = angle - turn_deg * ((radius > 26.0) & (radius < 50.0))
        picture: Picture = spots[(turned % 360.0 // 4.0).astype(int), np.minimum(radius // 2.0, 44.0).astype(int)]
        return picture

    frames = [(card(turn), IDENTITY) for turn in (0.0, 15.0, -40.0, 80.0, 120.0)]
    beside = Dial((CENTRE[0] + 1.0, CENTRE[1]), (18.0, 46.0), (0.0, 360.0))

    assert turning_px(Pictures(card(0.0), frames), beside) == pytest.approx((29.0, 49.0), abs=5.0)
    assert turning_px(Pictures(card(0.0), frames[:1] * 4), beside) is None


@pytest.mark.parametrize("ground", [0, 120, 200, 255])
@pytest.mark.parametrize("mark", [0, 60, 255])
@pytest.mark.parametrize("beside_px", [1, 3, 6, 12])
def test_any_mark_on_any_ground_has_an_angle(ground: int, mark: int, beside_px: int) -> None:
    """Dark marks on light ground too, and where what lies beside them is as dark as they are."""
    picture = np.full((160, 160), ground, np.uint8)
    picture[78:82, 120:140] = mark
    picture[80 + beside_px :, 120:140] = mark
    angle_deg = mark_angle_deg(picture, HERE, (130.0, 80.0))

    assert abs((angle_deg + 180.0) % 360.0 - 180.0) < 8.0


@pytest.mark.parametrize("needle_deg", [10.0, 200.0])
def test_a_dial_seen_from_aside_leaves_its_centre_in_doubt_by_as_much(needle_deg: float) -> None:
    """A circle through three places of an ellipse lies about another point; square on, the same three tell it well."""

    def doubt_px(lean: Lean) -> tuple[float, float]:
        ends = [around(angle, RING_PX, lean) for angle in (120.0, 225.0, 15.0)]
        beside_px = math.dist(circle_through(FLAT, ends).centre, CENTRE)
        return centre_doubt_px(dial(needle_deg, lean=lean), BLIND, ends), beside_px

    square_on_px, nothing_px = doubt_px(UPRIGHT)
    aside_px, beside_px = doubt_px(LEANING)

    assert nothing_px < 1e-6
    assert square_on_px < MAX_MOVE_PX
    assert aside_px > max(beside_px, MAX_MOVE_PX)
