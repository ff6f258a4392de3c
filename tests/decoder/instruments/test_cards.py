"""Moving cards: the value under the index, whatever fixed marks are over the card."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.instruments.kinds.dials.card import far_card_pivot, first_card, unlike_itself
from decoder.instruments.panel_reader import PanelReader, read_picture, unwrapped
from decoder.instruments.reading import Status
from decoder.learning.fit import FittedReader, fit_to_flight
from decoder.matching.pivot_search import card_squeeze
from decoder.panel.scale import Scale, shortest
from decoder.timeseries.flight_data import FlightDataBuilder
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.instruments.dials import CENTRE, Canvas, apart, paint, reader_for

PANEL_TURN_DEG = 40.0
INDEX_DEG = 270.0
CARD: dict[str, Any] = {
    "name": "heading",
    "radius": [34, 70],
    "sweep": [0, 360],
    "unit": "deg",
    # Where the marks lie in the panel picture: north, drawn at the top, has been turned by 40 degrees.
    "scale": [[INDEX_DEG + PANEL_TURN_DEG, 0], [INDEX_DEG + PANEL_TURN_DEG + 180, 180]],
    "wraps": 360,
    "card": {"name": "heading_deg", "index": INDEX_DEG},
}


def heading_of(turn_deg: float) -> float:
    """What a card turned clockwise from north by so many degrees shows at its index."""
    return -turn_deg % 360.0


def draw(turn_deg: float, seed: int = 0, over: Callable[[Canvas], object] = lambda _: None) -> GreyPicture:
    """Draws a card with marks and blocks for numerals below a lubber line and an aircraft symbol."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 76.0, 35.0)
        rng = np.random.default_rng(3)
        for mark in range(36):
            inner, half = (54.0, 1.6) if mark % 3 == 0 else (58.0, 1.0)
            canvas.bar(mark * 10 + turn_deg, (inner, 66.0), (half, half), 200.0)
        for numeral in range(12):
            for stroke in range(3):
                half, radius_px = rng.uniform(0.6, 3.0), 38.0 + 5 * stroke
                angle_deg = numeral * 30 + turn_deg + rng.uniform(-4, 4)
                canvas.bar(angle_deg, (radius_px, radius_px + 3.5), (half, half), 190.0)
        canvas.bar(INDEX_DEG, (40, 74), (1.6, 1.6), 235.0)
        for wing_deg in (0, 180):
            canvas.bar(wing_deg, (0, 44), (2.5, 2.5), 230.0)
        over(canvas)

    return paint(what, seed=seed)


@pytest.fixture(scope="module")
def first() -> PanelReader:
    """A reader that knows the panel picture alone."""
    return reader_for([CARD], draw(PANEL_TURN_DEG, 1))


@pytest.fixture(scope="module")
def reader() -> PanelReader:
    """A reader tuned to a flight in which the card went once around."""
    return reader_for([CARD], draw(PANEL_TURN_DEG, 1), [draw(3.0 + 22.5 * step, 100 + step) for step in range(16)])


def off_deg(reader: PanelReader, frame: GreyPicture, turn_deg: float) -> tuple[Status, float, float]:
    """Status of the heading, how far it is off the short way round, and its score."""
    reading = read_picture(reader, frame).readings["heading_deg"]
    value = Scale.of(CARD["scale"], 360.0).values_at(np.array([reading.angle_deg]))
    return reading.status, apart(float(value[0]), heading_of(turn_deg)), reading.score


@given(turn_deg=st.floats(0.0, 360.0), seed=st.integers(0, 1000))
@example(turn_deg=0.0, seed=0)
@example(turn_deg=40.0, seed=0)
@example(turn_deg=359.99, seed=0)
@settings(max_examples=20)
def test_card_is_read_at_any_turn(reader: PanelReader, turn_deg: float, seed: int) -> None:
    """To a twentieth of a degree, over the seam as well, unmoved by what stands still."""
    status, off, score = off_deg(reader, draw(turn_deg, seed), turn_deg)

    assert status is Status.READ
    assert off < 0.05
    assert score > 0.98


def test_card_that_turned_little_is_read_as_well() -> None:
    """A flight straight ahead except for one turn distinguishes the card from what is over it."""
    frames = [draw(30.0 + 2.5 * step, 200 + step) for step in range(16)]
    reader = reader_for([CARD], draw(PANEL_TURN_DEG, 1), frames)

    for turn_deg in (31.0, 44.4, 140.0, 300.0):
        status, off, _ = off_deg(reader, draw(turn_deg, 9), turn_deg)
        assert status is Status.READ
        assert off < 0.1


def aside(picture: GreyPicture, squeeze: Squeeze) -> GreyPicture:
    """The picture as it appears from aside."""
    centre = np.array(CENTRE)
    matrix = np.column_stack([squeeze.matrix, centre - squeeze.matrix @ centre])
    return np.asarray(cv2.warpAffine(picture, matrix, picture.shape[::-1], borderMode=cv2.BORDER_REPLICATE), np.uint8)


def appears_deg(angle_deg: float, squeeze: Squeeze) -> float:
    """Where an angle on the dial appears from aside."""
    angle = math.radians(angle_deg)
    x, y = squeeze.matrix @ [math.cos(angle), math.sin(angle)]
    return angle_deg + math.remainder(math.degrees(math.atan2(y, x)) - angle_deg, 360.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("squeeze", "off_px"),
    [(Squeeze(0.0225, 0.008), (0.5, -2.5)), (Squeeze(-0.015, 0.016), (2.0, 1.5))],
    ids=["above", "below"],
)
def test_squeeze_is_found_around_a_centre_that_is_drawn_off_the_pivot(
    squeeze: Squeeze, off_px: tuple[float, float]
) -> None:
    """Off its pivot a card does not look alike in any squeeze, nor squeezed around any pivot."""
    x, y = CENTRE
    drawn = reader_for([CARD | {"centre": [x + off_px[0], y + off_px[1]]}], aside(draw(PANEL_TURN_DEG, 1), squeeze))
    turned = [aside(draw(3.0 + 43.5 * step, 100 + step), squeeze) for step in range(8)]
    strips = [frame.gauges[0] for frame in unwrapped(drawn, turned)]

    found = card_squeeze(drawn.grids[0], strips)

    assert found is not None
    assert np.allclose(found.matrix, squeeze.matrix, atol=0.005)


def card_aside(squeeze: Squeeze, zero_deg: float) -> dict[str, Any]:
    """The card as somebody draws it who sees it from aside, its zero turned to `zero_deg`."""
    return CARD | {
        "scale": [[appears_deg(zero_deg + angle_deg, squeeze), angle_deg] for angle_deg in (0, 180)],
        "card": {"name": "heading_deg", "index": appears_deg(INDEX_DEG, squeeze)},
    }


def off_aside_deg(fitted: FittedReader, frame: GreyPicture, turn_deg: float) -> float:
    """How far off a card is read that was drawn from aside."""
    reading = read_picture(fitted.reader, frame).readings["heading_deg"]
    (value,) = Scale.of(fitted.panel.gauges[0].scale, 360.0).values_at(np.array([reading.angle_deg]))
    assert reading.status is Status.READ
    return apart(float(value), heading_of(turn_deg))


@pytest.mark.slow
@pytest.mark.parametrize("has_bug", [False, True], ids=["card", "card and bug"])
def test_card_seen_from_aside_is_squared_up_and_read(*, has_bug: bool) -> None:
    """Drawn as if seen square on, it shows its marks out of step as it turns; nothing else is known of the view.

    What squares it up is not held against a bug that only the panel picture shows, and that stays lost.
    """
    squeeze = Squeeze(-0.03, 0.02) if has_bug else Squeeze(0.01, -0.06)
    card, panel = card_aside(squeeze, INDEX_DEG + PANEL_TURN_DEG), draw(PANEL_TURN_DEG, 1)
    if has_bug:
        card["needles"] = [{"name": "bug_deg", "template": {"at": appears_deg(340.0, squeeze), "span": 20}}]
        panel = draw(PANEL_TURN_DEG, 1, lambda canvas: canvas.bar(340.0, (58, 72), (6.0, 6.0), 120.0))
    frames = [aside(draw(3.0 + 22.5 * step, 100 + step), squeeze) for step in range(16)]

    fitted = fit_to_flight(reader_for([card], aside(panel, squeeze)), lambda _: frames)

    (found,) = fitted.squeezes
    assert found is not None
    assert np.allclose(found.matrix, squeeze.matrix, atol=0.01)
    for turn_deg in (31.0, 44.4, 140.0, 300.0):
        frame = aside(draw(turn_deg, 9), squeeze)
        assert off_aside_deg(fitted, frame, turn_deg) < 0.2
        if has_bug:
            assert read_picture(fitted.reader, frame).readings["bug_deg"].status is Status.MISSING


def draw_letters(turn_deg: float, seed: int) -> GreyPicture:
    """Draws a card that has nothing but blocks for letters, around a plate that stands still."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 76.0, 35.0)
        rng = np.random.default_rng(111)
        for letter in range(12):
            for _ in range(rng.integers(2, 5)):
                inner_px, half = rng.uniform(60.0, 66.0), rng.uniform(0.7, 2.0)
                radii = (inner_px, inner_px + rng.uniform(3.0, 8.0))
                canvas.bar(letter * 30 + turn_deg + rng.uniform(-5.0, 5.0), radii, (half, half), 190.0)
        canvas.bar(INDEX_DEG, (40.0, 56.0), (1.0, 1.0), 150.0)

    return paint(what, seed=seed)


@pytest.mark.slow
def test_card_seen_from_aside_is_not_read_around_a_point_far_off_its_pivot() -> None:
    """On an ellipse, letters match themselves better around some point far off, and some turns only around that."""
    squeeze, turns_deg = Squeeze(0.03, 0.035), [0.0, -20.0, -45.0, 20.0, 40.0, -60.0, 60.0, -80.0]
    card = card_aside(squeeze, INDEX_DEG) | {"radius": [50, 73]}
    frames = [aside(draw_letters(turn_deg, 50 + index), squeeze) for index, turn_deg in enumerate(turns_deg)]

    fitted = fit_to_flight(reader_for([card], aside(draw_letters(0.0, 1), squeeze)), lambda _: frames)

    for turn_deg in (-70.0, -33.0, 10.0, 52.0):
        assert off_aside_deg(fitted, aside(draw_letters(turn_deg, 9), squeeze), turn_deg) < 0.3


def test_marks_over_a_card_at_regular_distances_are_not_taken_for_its_own() -> None:
    """A radio compass's wedges every 45 degrees, over a card that was set by hand to places 45 degrees apart."""

    def wedges(canvas: Canvas) -> None:
        for wedge in range(8):
            canvas.bar(INDEX_DEG + 45 * wedge, (56, 76), (0.5, 4.0), 200.0)

    settings_deg = (PANEL_TURN_DEG, PANEL_TURN_DEG + 45.0, 150.0)
    frames = [draw(settings_deg[step // 6], 100 + step, wedges) for step in range(18)]
    reader = reader_for([CARD], draw(settings_deg[0], 1, wedges), frames)

    for turn_deg in (*settings_deg, 222.0):
        status, off, score = off_deg(reader, draw(turn_deg, 9, wedges), turn_deg)
        assert status is Status.READ
        assert off < 0.05
        assert score > 0.95  # with the wedges on the card it does not match wherever they are not


@pytest.mark.slow
def test_card_under_more_than_it_shows_is_not_guessed() -> None:
    """Most of the picture stands still and the flight has only two turns: no false heading is read."""
    turn_deg = 280.0

    def over(canvas: Canvas) -> None:
        canvas.bar(20, (-60, 60), (9, 9), 220)
        for mark in range(12):
            canvas.bar(mark * 30, (66, 74), (2, 2), 230)

    frames = [draw(PANEL_TURN_DEG if seed < 9 else turn_deg, 500 + seed, over) for seed in range(16)]
    fitted = fit_to_flight(reader_for([CARD], draw(PANEL_TURN_DEG, 1, over)), lambda _: frames).reader
    status, off, _ = off_deg(fitted, draw(turn_deg, 7, over), turn_deg)
    own_status, own_off, _ = off_deg(fitted, draw(PANEL_TURN_DEG, 8, over), PANEL_TURN_DEG)

    assert status is Status.MISSING or off < 0.5
    assert (own_status, own_off < 0.5) == (Status.READ, True)


@pytest.mark.parametrize("turn_deg", [25.0, 271.0])
def test_bug_on_the_card_does_not_pull(reader: PanelReader, turn_deg: float) -> None:
    """A bright bug beside the index moves nothing."""
    frame = draw(turn_deg, 5, lambda canvas: canvas.bar(INDEX_DEG + 9, (56, 70), (4, 4), 235))
    status, off, _ = off_deg(reader, frame, turn_deg)

    assert status is Status.READ
    assert off < 0.1


@pytest.mark.parametrize("turn_deg", [25.0, 271.0])
def test_covered_card_is_not_guessed(reader: PanelReader, turn_deg: float) -> None:
    """Under a hand there is no heading, or the right one."""
    for half_px in (30.0, 100.0):

        def hand_over(canvas: Any, half_px: float = half_px) -> None:  # noqa: ANN401
            canvas.bar(45, (-90, 90), (half_px, half_px), 150)

        status, off, _ = off_deg(reader, draw(turn_deg, 5, hand_over), turn_deg)
        assert status is Status.MISSING or off < 1.0
    assert status is Status.MISSING


def test_card_goes_into_the_flight_data(first: PanelReader) -> None:
    """Fitted to its flight the card is a column like any needle, with a heading for every frame and a fair sigma."""
    turns_deg = [300.0 + 6.0 * step for step in range(16)]
    frames = [draw(turn_deg, 300 + seed) for seed, turn_deg in enumerate(turns_deg)]
    fitted = fit_to_flight(first, lambda _: frames[::2])
    builder = FlightDataBuilder(first.source.panel)
    for index, frame in enumerate(frames):
        builder.add(index, index * 500_000_000, read_picture(fitted.reader, frame))
    (series,) = fill_gaps(builder.build(fitted.sigma_deg)).series

    off = shortest(series.value - np.array([heading_of(turn_deg) for turn_deg in turns_deg]), 360.0)
    assert series.quantity.name == "heading_deg"
    assert series.has(Status.READ).all()
    assert np.abs(off).max() < 0.1
    assert (np.abs(off) < 1.96 * series.sigma).all()


def check_settings(settings_deg: Sequence[float], beside_px: tuple[float, float], inner_px: float) -> None:
    """Fit to a flight in which a card, drawn beside its pivot, was set by hand, and read each of its settings."""
    card = {**CARD, "centre": (np.array(CENTRE) + beside_px).tolist(), "radius": [inner_px, 72]}
    turns_deg = np.repeat(settings_deg, 5).tolist()
    frames = [draw(turn_deg, 500 + seed) for seed, turn_deg in enumerate(turns_deg)]
    fitted = fit_to_flight(reader_for([card], draw(PANEL_TURN_DEG, 1)), lambda _: frames)

    for turn_deg in settings_deg:
        status, off, _ = off_deg(fitted.reader, draw(turn_deg, 19), turn_deg)
        assert status is Status.READ
        assert off < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("beside_px", [(0.7, -0.6), (-4.0, 3.0)], ids=["1 %", "7 %"])
def test_card_that_is_set_to_few_places_is_read_around_its_own_pivot(beside_px: tuple[float, float]) -> None:
    """A course selector stands at three places in a flight; that its centre is drawn beside its pivot costs nothing."""
    check_settings((40.0, 345.0, 205.0), beside_px, 34)


@pytest.mark.slow
@pytest.mark.parametrize("beside_px", [(-1.2, 1.7), (-4.0, 3.0)], ids=["3 %", "7 %"])
def test_marks_that_match_other_marks_do_not_hide_that_the_centre_is_beside_the_pivot(
    beside_px: tuple[float, float],
) -> None:
    """Settings a multiple of the marks' spacing apart look as if the card hardly turned, since numerals match worse."""
    check_settings((40.0, 220.0, 140.0), beside_px, 42)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings_deg", "beside_px"),
    [
        ((40.0, 345.0, 205.0), (-1.2, 1.7)),
        ((255.0, 145.0, 355.0, 225.0), (0.7, -0.6)),
        ((180.0, 270.0, 150.0), (0.7, -0.6)),
    ],
)
def test_ring_of_little_but_marks_is_never_read_a_numeral_off(
    settings_deg: tuple[float, ...], beside_px: tuple[float, float]
) -> None:
    """Marks match marks at every tenth degree; only the feet of numerals, turned by all frames alike, tell the turn."""
    check_settings(settings_deg, beside_px, 44)


def draw_arc(turn_deg: float, seed: int = 0) -> GreyPicture:
    """A card with a mark every five degrees, of which a plate with print on it leaves only the top."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 76.0, 60.0)
        rng = np.random.default_rng(3)
        for mark in range(72):
            canvas.bar(mark * 5 + turn_deg, (61.0 if mark % 2 else 56.0, 68.0), (1.2, 1.2), 220.0)
        for numeral in range(12):
            for inner_px in (38.0, 43.0, 48.0):
                half = rng.uniform(0.6, 2.0)
                canvas.bar(
                    numeral * 30 + turn_deg + rng.uniform(-3, 3), (inner_px, inner_px + 3.0), (half, half), 190.0
                )
        x, y = CENTRE
        canvas.polygon([(x - 90, y - 22), (x + 90, y - 22), (x + 90, y + 90), (x - 90, y + 90)], 40.0)
        for left in range(-60, 60, 20):
            canvas.polygon(
                [(x + left, y + 30), (x + left + 10, y + 30), (x + left + 10, y + 40), (x + left, y + 40)], 200.0
            )
        canvas.bar(INDEX_DEG, (0, 68), (0.8, 0.8), 235.0)

    return paint(what, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("off_px", [(0.0, 0.0), (-1.0, 2.0)], ids=["centred", "below"])
def test_card_of_which_an_arc_shows_is_never_read_a_numeral_off(off_px: tuple[float, float]) -> None:
    """Its regular marks were taken for each other, and its numerals had no weight since they fitted at no turn."""
    x, y = CENTRE
    card = CARD | {"centre": [x + off_px[0], y + off_px[1]]}
    turns_deg = [PANEL_TURN_DEG + 60.0 * math.sin(0.375 * number) for number in range(16)]
    frames = [draw_arc(turn_deg, 100 + number) for number, turn_deg in enumerate(turns_deg)]
    fitted = fit_to_flight(reader_for([card], draw_arc(PANEL_TURN_DEG, 1)), lambda _: frames).reader

    found = [off_deg(fitted, draw_arc(turn_deg, 500), turn_deg) for turn_deg in turns_deg]

    assert [off for status, off, _ in found if status is not Status.MISSING and off > 3.0] == []


def draw_rose(turn_deg: float, seed: int = 0) -> GreyPicture:
    """Draws a compass rose, four like letters and faint figures between them, behind glass that mirrors a window."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 76.0, 15.0)
        rng = np.random.default_rng(11)
        for letter in range(4):
            for stroke in range(3):
                at_deg, half = letter * 90 + turn_deg + rng.uniform(-4, 4), rng.uniform(1.0, 2.0)
                canvas.bar(at_deg, (52.0 + 4 * stroke, 56.0 + 4 * stroke), (half, half), 110.0)
        for figure in range(36):
            at_deg = figure * 10 + turn_deg + rng.uniform(-2, 2)
            canvas.bar(at_deg, (58.0, 62.0), (rng.uniform(1.0, 2.5),) * 2, 45.0)

    rose = paint(what, seed=seed)
    y, x = np.indices(rose.shape)
    far = np.hypot(x - CENTRE[0] + 50, y - CENTRE[1] + 50)
    return np.clip(rose + 60.0 * np.clip(1 - far / 90, 0, 1), 0, 255).astype(np.uint8)


def test_light_that_stands_still_over_a_card_is_not_taken_for_it() -> None:
    """Glass that mirrors more light than the print reflects does not hold the card, nor turn it to the next letter."""
    card = {**CARD, "radius": [50, 68]}
    frames = [draw_rose(turn_deg, 400 + seed) for seed, turn_deg in enumerate([40.0] * 8 + [75.0, 110.0, 145.0, 180.0])]
    reader = reader_for([card], draw_rose(PANEL_TURN_DEG, 1), frames)

    for turn_deg in (40.0, 90.0, 145.0, 200.0, 300.0):
        status, off, _ = off_deg(reader, draw_rose(turn_deg, 9), turn_deg)
        assert status is Status.READ
        assert off < 0.2


def in_sun(frame: GreyPicture, number: int) -> GreyPicture:
    """A frame with the shadow of a window post across it, and a bright window mirrored in the glass, each elsewhere."""
    y, x = np.indices(frame.shape)
    is_dial = np.hypot(x - CENTRE[0], y - CENTRE[1]) < 78.0
    away_deg = 37.0 * number
    across = (x - CENTRE[0]) * math.cos(math.radians(away_deg)) + (y - CENTRE[1]) * math.sin(math.radians(away_deg))
    in_shadow = across > 50.0 * math.sin(2.1 * number)
    is_mirrored = np.abs(across - 40.0 * math.cos(1.3 * number)) < 25.0
    lit = frame * np.where(in_shadow, 0.6, 1.1) + 20.0 * is_mirrored
    return np.clip(np.where(is_dial, lit, frame), 0, 255).astype(np.uint8)


def out_of_focus(picture: GreyPicture) -> GreyPicture:
    """The picture, blurred by two pixels."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 2.0), np.uint8)


def half_in_shade(picture: GreyPicture) -> GreyPicture:
    """The picture, its right half in a quarter of the light."""
    return np.where(np.indices(picture.shape)[1] > CENTRE[0], 0.25 * picture, picture).astype(np.uint8)


def half_in_glare(picture: GreyPicture) -> GreyPicture:
    """The picture, its lower part washed out."""
    return np.where(np.indices(picture.shape)[0] > CENTRE[1] + 15, np.minimum(picture + 130.0, 255), picture).astype(
        np.uint8
    )


@pytest.mark.parametrize("spoilt", [np.asarray, out_of_focus, half_in_shade, half_in_glare])
def test_card_is_read_under_shadows_and_reflections_that_move_over_all_of_it(
    spoilt: Callable[[GreyPicture], GreyPicture],
) -> None:
    """Frames then differ everywhere by more than a camera's noise, but by less than the card's contrast.

    If the panel picture hardly shows it, the card matches no place there much better than others; all frames agree on
    the place with it.
    """
    turns_deg = [3.0 + 22.5 * step for step in range(16)]
    frames = [in_sun(draw(turn_deg, 100 + step), step) for step, turn_deg in enumerate(turns_deg)]
    reader = reader_for([CARD], spoilt(draw(PANEL_TURN_DEG, 1)), frames)

    found = [off_deg(reader, frame, turn_deg) for frame, turn_deg in zip(frames, turns_deg, strict=True)]

    assert sum(status is Status.READ for status, _, _ in found) >= 14
    assert max(off for status, off, _ in found if status is Status.READ) < 0.2


def draw_points(turn_deg: float, seed: int, *, squeeze: float = 1.0) -> GreyPicture:
    """A compass rose: eight points alike, and four small letters of different width, all seen `squeeze` as high."""

    def what(canvas: Canvas) -> None:
        canvas.disc(CENTRE, 76.0, 120.0)
        for point in range(8):
            angle = math.radians(45.0 * point + turn_deg)
            out, aside = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
            for side, level in ((-1.0, 60.0), (1.0, 220.0)):
                corners = np.array([0.0 * out, out * 22.0 + side * 9.0 * aside, out * 62.0]) * [1.0, squeeze] + CENTRE
                canvas.polygon([(x, y) for x, y in corners.tolist()], level)
        for letter, half in enumerate((1.0, 2.0, 3.0, 0.6)):
            canvas.bar(90.0 * letter + turn_deg, (66.0, 70.0), (half, half), 190.0)

    return paint(what, seed=seed)


MOSTLY_STRAIGHT_AHEAD_DEG = [*8 * [0.0], 6.0, 20.0, -9.0, 33.0, 50.0, 77.0, 30.0, 38.0]


@pytest.mark.slow
def test_rose_is_never_read_a_point_off() -> None:
    """Seen obliquely, and drawn around a point beside its pivot, it matches best at the point nearest the panel's."""
    squeeze = 0.94
    rose = CARD | {"radius": [26, 73], "centre": [CENTRE[0] + 3.7, CENTRE[1] + 3.7]}
    frames = [
        draw_points(PANEL_TURN_DEG + turn_deg, 30 + seed, squeeze=squeeze)
        for seed, turn_deg in enumerate(MOSTLY_STRAIGHT_AHEAD_DEG)
    ]
    panel = draw_points(PANEL_TURN_DEG, 1, squeeze=squeeze)
    fitted = fit_to_flight(reader_for([rose], panel), lambda _: frames)

    found = [
        off_deg(fitted.reader, draw_points(PANEL_TURN_DEG + turn_deg, 9, squeeze=squeeze), PANEL_TURN_DEG + turn_deg)
        for turn_deg in range(0, 360, 15)
    ]

    assert [off for status, off, _ in found if status is Status.READ and off > 3.0] == []
    assert any("looks nearly alike at several turns" in said for said in fitted.findings["heading"])


def test_pivot_of_a_rose_is_found_though_its_points_are_all_alike() -> None:
    """That a turn is unclear by whole points does not matter for where the rose turns."""
    x, y = CENTRE
    rose = CARD | {"radius": [26, 73], "centre": [x + 2.0, y - 3.0]}
    drawn = reader_for([rose], draw_points(PANEL_TURN_DEG, 1))
    frames = [draw_points(PANEL_TURN_DEG + 22.5 * each, 30 + each) for each in range(16)]

    found = far_card_pivot(drawn.grids[0], [frame.gauges[0] for frame in unwrapped(drawn, frames)])

    assert found == pytest.approx((-2.0, 3.0), abs=0.5)


@pytest.mark.parametrize(("draw_card", "least", "most"), [(draw, 0.15, 0.5), (draw_points, 0.0, 0.05)])
def test_numerals_tell_a_turn_from_others_and_points_do_not(
    draw_card: Callable[[float, int], GreyPicture], least: float, most: float
) -> None:
    """A card with numerals is unlike itself at any other turn, even if parts of it are displaced; a rose is not."""
    panel = draw_card(PANEL_TURN_DEG, 1)
    reader = reader_for([CARD | {"radius": [26, 73]}], panel)
    (seen,) = unwrapped(reader, [panel])
    card = first_card(seen.gauges[0], reader.grids[0])

    assert least <= unlike_itself(reader.source.panel.gauges[0], card) <= most
