"""Needles and bugs over a turning card: what they show on the dial, and on the card below them."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.instruments.kinds.dials.card_parallax import CardParallax, parallax_of
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import fit_to_flight
from decoder.panel.gauge import Gauge
from decoder.panel.scale import Scale
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, reader_for
from tests.decoder.instruments.test_cards import CARD, INDEX_DEG, PANEL_TURN_DEG, draw, heading_of

BUG_LEVEL = 105.0
PANEL_BUG, PANEL_BEARING_DEG = 60.0, 200.0
BUG: dict[str, Any] = {
    **CARD,
    "needles": [{"name": "bug_deg", "template": {"at": INDEX_DEG + PANEL_TURN_DEG + PANEL_BUG, "span": 20}}],
}
POINTER: dict[str, Any] = {
    **CARD,
    "radius": [14, 70],
    "tail": True,
    "card": {**CARD["card"], "ring": 48},
    "needles": [
        {
            "name": "bearing_deg",
            "template": {"at": PANEL_BEARING_DEG, "span": 16},
            "scale": [[INDEX_DEG, 0], [INDEX_DEG + 180, 180]],
            "wraps": 360,
            "on_card": "track_deg",
        }
    ],
}
ARROW = Hand(tip=62.0, tail=44.0)


def with_bug(
    turn_deg: float, bug: float | None, seed: int = 0, level: float = BUG_LEVEL, parallax_deg: float = 0.0
) -> GreyPicture:
    """Draws the card with a bug, darker than its marks, at a heading; seen from the left it shifts to the right."""

    def over(canvas: Canvas) -> None:
        if bug is not None:
            at_deg = INDEX_DEG + turn_deg + bug
            at_deg -= parallax_deg * math.sin(math.radians(at_deg))
            canvas.bar(at_deg, (52.0, 70.0), (2.0, 4.5), level)

    return draw(turn_deg, seed, over)


def with_pointer(turn_deg: float, at_deg: float, seed: int = 0) -> GreyPicture:
    """Draws the card with a pointer over it."""
    return draw(turn_deg, seed, lambda canvas: canvas.hand(ARROW, at_deg))


def taught(gauge: dict[str, Any], first: GreyPicture, frames: Sequence[GreyPicture]) -> PanelReader:
    """A reader that learned from a flight what card and needles look like; their pivot is drawn right."""
    return reader_for([gauge], first, frames)


def fitted(gauge: dict[str, Any], first: GreyPicture, frames: Sequence[GreyPicture]) -> PanelReader:
    """A reader fitted to a flight."""
    return fit_to_flight(reader_for([gauge], first), lambda _: frames).reader


def off(reading: Reading, marks: Sequence[Sequence[float]], truth: float) -> float:
    """How far a reading is off the short way round."""
    marks_ = tuple((float(at), float(value)) for at, value in marks)
    value = Scale.of(marks_, 360.0).values_at(np.array([reading.angle_deg]))
    return apart(float(value[0]), truth)


@pytest.fixture(scope="module")
def bugged() -> PanelReader:
    """A reader of a card with a bug that was at four headings in flight, and over a numeral in the panel picture."""
    frames = [with_bug(3.0 + 22.5 * step, (60.0, 10.0, 275.0, 148.0)[step % 4], 100 + step) for step in range(16)]
    return taught(BUG, with_bug(PANEL_TURN_DEG, PANEL_BUG, 1), frames)


@pytest.fixture(scope="module")
def over_numeral() -> PanelReader:
    """A reader of a thin pointer that is drawn over a numeral."""
    return arrow_reader(90.0)


@pytest.fixture(scope="module")
def pointed() -> PanelReader:
    """A reader of a card below a pointer with a tail; both moved in flight."""
    frames = [with_pointer(3.0 + 22.5 * step, 40.0 + 51.0 * step, 200 + step) for step in range(16)]
    return taught(POINTER, with_pointer(PANEL_TURN_DEG, PANEL_BEARING_DEG, 1), frames)


def is_free(at_deg: float) -> bool:
    """Whether a needle is clear of the fixed index and wings."""
    return apart(at_deg, 0.0, 90.0) > 20.0


def is_honest(reading: Reading, marks: Sequence[Sequence[float]], truth: float) -> bool:
    """Whether it is missing, or right within what it claims."""
    return reading.status is Status.MISSING or off(reading, marks, truth) < max(0.25, 3.0 * reading.sigma_deg)


@given(turn_deg=st.floats(0.0, 360.0), bug=st.floats(0.0, 360.0), seed=st.integers(0, 1000))
@settings(max_examples=15)
def test_bug_is_read_on_the_card(bugged: PanelReader, turn_deg: float, bug: float, seed: int) -> None:
    """At any heading of bug and card, with less certainty below fixed marks. It does not pull the card."""
    readings = read_picture(bugged, with_bug(turn_deg, bug, seed)).readings
    own, card = readings["bug_deg"], readings["heading_deg"]

    assert (card.status, off(card, CARD["scale"], heading_of(turn_deg)) < 0.1) == (Status.READ, True)
    assert own.status is Status.READ or not is_free(turn_deg + bug)
    assert is_honest(own, CARD["scale"], bug)


def squeezed(picture: GreyPicture) -> GreyPicture:
    """What the camera sees of a card whose view is known to within .7 % only."""
    matrix, centre = Squeeze(0.006, -0.004).matrix, np.array(CENTRE)
    seen = np.column_stack([matrix, centre - matrix @ centre])
    return np.asarray(cv2.warpAffine(picture, seen, picture.shape[::-1], flags=cv2.INTER_CUBIC), np.uint8)


def test_dim_bug_over_a_card_that_is_squeezed_a_little_is_learned() -> None:
    """Turned back, its marks lie beside themselves in all frames, which does not count as a bug."""
    bugs = (PANEL_BUG, 10.0, 275.0, 148.0)
    frames = [squeezed(with_bug(3.0 + 22.5 * step, bugs[step // 4], 100 + step)) for step in range(16)]
    reader = taught(BUG, squeezed(with_bug(PANEL_TURN_DEG, PANEL_BUG, 1)), frames)

    shown = [(7.0 + 22.5 * step, (10.0, 275.0, 148.0, 333.0)[step % 4], 500 + step) for step in range(16)]
    readings = [read_picture(reader, squeezed(with_bug(*each))).readings["bug_deg"] for each in shown]
    off_deg = [off(own, CARD["scale"], bug) for own, (_, bug, _) in zip(readings, shown, strict=True) if own.is_seen]

    assert len(off_deg) >= 12
    assert max(off_deg) < 2.0


@pytest.mark.parametrize("level", [60.0, BUG_LEVEL])
def test_bug_that_never_moved_may_be_a_mark_of_its_card(level: float) -> None:
    """A match in its place is never more than `edge`; what lies behind it is unknown, so later it is not guessed."""
    frames = [with_bug(3.0 + 22.5 * step, PANEL_BUG, 100 + step, level) for step in range(16)]
    reader = taught(BUG, with_bug(PANEL_TURN_DEG, PANEL_BUG, 1, level), frames)
    readings = [read_picture(reader, frame).readings["bug_deg"] for frame in frames]

    found = [own for own in readings if own.status is not Status.MISSING]

    assert {own.status for own in found} == {Status.EDGE}
    assert len(found) >= 12
    assert all(off(own, CARD["scale"], PANEL_BUG) < 1.0 for own in found)
    for bug in (PANEL_BUG, 10.0, 148.0, 275.0):
        reading = read_picture(reader, with_bug(111.0, bug, 8, level)).readings["bug_deg"]
        assert reading.status is not Status.READ
        assert is_honest(reading, CARD["scale"], bug)


@pytest.mark.slow
@pytest.mark.parametrize(("level", "light", "least"), [(60.0, 1.0, 0), (BUG_LEVEL, 1.0, 14), (BUG_LEVEL, 0.25, 0)])
def test_numeral_behind_a_bug_is_not_read_for_it(level: float, light: float, least: int) -> None:
    """Even if the card turned little, below marks that stand still; in dim light the two cannot be distinguished."""
    settings_ = [PANEL_BUG] * 6 + [148.0] * 5 + [275.0] * 5
    drawn = [with_bug(3.0 + 3.0 * step, bug, 100 + step, level) for step, bug in enumerate(settings_)]
    first, *frames = (
        np.rint(picture * light).astype(np.uint8) for picture in (with_bug(PANEL_TURN_DEG, PANEL_BUG, 1, level), *drawn)
    )
    reader = taught(BUG, first, frames)
    readings = [read_picture(reader, frame).readings["bug_deg"] for frame in frames]

    assert sum(own.status is Status.READ for own in readings) >= least
    assert all(is_honest(own, CARD["scale"], bug) for own, bug in zip(readings, settings_, strict=True))


@pytest.mark.parametrize("bug", [PANEL_BUG, 148.0])
def test_what_may_be_a_mark_may_be_anywhere(bug: float) -> None:
    """A card that hardly turned does not tell what stands still over it, and that could be taken for the bug."""
    frames = [with_bug(33.0 + step, bug, 100 + step) for step in range(16)]
    reader = taught(BUG, with_bug(PANEL_TURN_DEG, PANEL_BUG, 1), frames)
    readings = [read_picture(reader, frame).readings["bug_deg"] for frame in frames]

    assert all(own.status is Status.MISSING or own.sigma_deg > 90.0 for own in readings)


@pytest.mark.slow
def test_bug_that_is_seen_from_aside_is_read_where_it_points() -> None:
    """It swings by its height above the card as the card turns, but stays where it was set: the swing is removed."""
    parallax_deg, settings_ = 1.2, [60.0] * 6 + [148.0] * 6 + [275.0] * 6
    at_deg = INDEX_DEG + PANEL_TURN_DEG + PANEL_BUG
    drawn = copy.deepcopy(BUG)
    drawn["needles"][0]["template"]["at"] = at_deg - parallax_deg * math.sin(math.radians(at_deg))
    first = with_bug(PANEL_TURN_DEG, PANEL_BUG, 1, parallax_deg=parallax_deg)
    turns_deg = [3.0 + 47.0 * step for step in range(len(settings_))]
    frames = [
        with_bug(turn_deg, bug, 300 + number, parallax_deg=parallax_deg)
        for number, (turn_deg, bug) in enumerate(zip(turns_deg, settings_, strict=True))
    ]
    reader = fitted(drawn, first, frames)

    readings = [read_picture(reader, frame).readings["bug_deg"] for frame in frames]
    errors = [
        off(own, CARD["scale"], bug) for own, bug in zip(readings, settings_, strict=True) if own.status is Status.READ
    ]

    assert len(errors) >= len(frames) // 2
    assert max(errors) < parallax_deg / 4


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.integers(0, 1000))
def test_parallax_is_told_by_what_goes_round_with_its_card(right_deg: float, down_deg: float, seed: int) -> None:
    """Even though somebody sets it now and then."""
    rng = np.random.default_rng(seed)
    seen_deg, set_deg = rng.uniform(0, 360, 24), np.repeat(rng.uniform(0, 360, 4), 6)
    swing_deg = right_deg * np.cos(np.radians(seen_deg)) + down_deg * np.sin(np.radians(seen_deg))

    told = parallax_of(seen_deg, set_deg + swing_deg + rng.normal(0, 0.03, 24), 0.03)

    assert (told.right_deg, told.down_deg) == pytest.approx((right_deg, down_deg), abs=0.12)


@pytest.mark.parametrize("seed", range(3))
def test_no_parallax_is_told_by_what_does_not_show_it(seed: int) -> None:
    """A needle that moves independently, one that hardly goes round, and one seen from straight ahead."""
    rng = np.random.default_rng(seed)
    seen_deg, set_deg, noise_deg = rng.uniform(0, 360, 24), np.repeat([10.0, 200.0], 12), rng.normal(0, 0.03, 24)

    assert parallax_of(seen_deg, rng.uniform(0, 360, 24), 0.03) == CardParallax()
    assert parallax_of(seen_deg / 360, set_deg + noise_deg, 0.03) == CardParallax()
    assert parallax_of(seen_deg, set_deg + noise_deg, 0.03) == CardParallax()
    assert parallax_of(seen_deg[:1], set_deg[:1], 0.03) == CardParallax()


@given(turn_deg=st.floats(0.0, 360.0), at_deg=st.floats(0.0, 360.0), seed=st.integers(0, 1000))
@settings(max_examples=15)
def test_pointer_is_read_on_the_dial_and_on_the_card(
    pointed: PanelReader, turn_deg: float, at_deg: float, seed: int
) -> None:
    """Its value on the card follows from its angle on the dial and the card's heading; it does not pull the card."""
    readings = read_picture(pointed, with_pointer(turn_deg, at_deg, seed)).readings
    bearing, track, card = (readings[name] for name in ("bearing_deg", "track_deg", "heading_deg"))
    truth = (at_deg - INDEX_DEG) % 360.0

    assert {bearing.status, track.status, card.status} == {Status.READ} or not is_free(at_deg)
    assert is_honest(card, CARD["scale"], heading_of(turn_deg))
    assert is_honest(bearing, POINTER["needles"][0]["scale"], truth)
    assert is_honest(track, CARD["scale"], truth + heading_of(turn_deg))


@pytest.mark.slow
def test_pointer_seen_from_aside_is_never_read_for_its_reverse() -> None:
    """Above its card it turns about another point than the card, so that it resembles its reverse by where it lies."""
    raised = Hand(tip=56.0, tail=50.0, root_half=1.6, tail_half=1.2, centre=(CENTRE[0] + 1.2, CENTRE[1] - 1.6))

    def picture(turn_deg: float, at_deg: float, seed: int) -> GreyPicture:
        def over(canvas: Canvas) -> None:
            canvas.hand(raised, at_deg)
            canvas.bar(at_deg, (36.0, 56.0), (4.0, 0.5), raised.level, raised.centre)

        return draw(turn_deg, seed, over)

    frames = [picture(3.0 + 22.5 * step, 40.0 + 51.0 * step, 200 + step) for step in range(16)]
    reader = fitted(POINTER, picture(PANEL_TURN_DEG, PANEL_BEARING_DEG, 1), frames)
    found = [read_picture(reader, picture(17.0 * step, 41.0 * step, 300 + step)).readings for step in range(16)]
    beyond_deg = [
        apart(readings["bearing_deg"].angle_deg, 41.0 * step) - 2.0 * readings["bearing_deg"].sigma_deg
        for step, readings in enumerate(found)
        if readings["bearing_deg"].status is not Status.MISSING
    ]

    assert max(beyond_deg) < 3.0, beyond_deg  # it lies up to two degrees aside
    assert len(beyond_deg) > 4


def with_arrow(turn_deg: float, at_deg: float, seed: int = 0) -> GreyPicture:
    """Draws the card with a thin pointer over it, whose small head alone tells its tip from its tail."""
    thin = Hand(tip=60.0, tail=56.0, root_half=1.3, tail_half=1.3)

    def over(canvas: Canvas) -> None:
        canvas.hand(thin, at_deg)
        canvas.bar(at_deg, (44.0, 58.0), (3.2, 0.4), thin.level)

    return draw(turn_deg, seed, over)


def arrow_reader(drawn_deg: float) -> PanelReader:
    """A reader of a thin pointer that is drawn at such an angle."""
    (needle,) = POINTER["needles"]
    gauge = {**POINTER, "needles": [{**needle, "template": {"at": drawn_deg, "span": 16}}]}
    frames = [with_arrow(3.0 + 22.5 * step, 40.0 + 51.0 * step, 200 + step) for step in range(16)]
    return taught(gauge, with_arrow(PANEL_TURN_DEG, drawn_deg, 1), frames)


def arrows_off_deg(reader: PanelReader) -> list[float]:
    """By how much a thin pointer's bearings are off that have a value, of twelve."""
    found = [read_picture(reader, with_arrow(31.0 * step, 41.0 * step, 300 + step)).readings for step in range(12)]
    return [
        apart(readings["bearing_deg"].angle_deg, 41.0 * step)
        for step, readings in enumerate(found)
        if readings["bearing_deg"].status is not Status.MISSING
    ]


def test_frames_together_tell_the_tip_of_a_pointer_that_is_drawn_over_a_numeral(over_numeral: PanelReader) -> None:
    """Its head does not show there, and one frame alone does not say which end it is."""
    off_deg = arrows_off_deg(over_numeral)

    assert len(off_deg) >= 9
    assert max(off_deg) < 1.0


@pytest.mark.slow
def test_card_whose_pointer_is_never_found_is_not_read_a_numeral_off() -> None:
    """Around a centre drawn a fifth of the radius off, what turned may be the pointer, taken for a part of the card."""
    x, y = CENTRE
    turns_deg = [PANEL_TURN_DEG + 2.0 * step for step in range(16)]
    frames = [with_pointer(turn_deg, 200.0 + 7.0 * step % 120.0, 300 + step) for step, turn_deg in enumerate(turns_deg)]
    reader = fitted({**POINTER, "centre": [x, y + 14.0]}, with_pointer(PANEL_TURN_DEG, PANEL_BEARING_DEG, 1), frames)

    for frame, turn_deg in zip(frames, turns_deg, strict=True):
        card = read_picture(reader, frame).readings["heading_deg"]
        assert is_honest(card, CARD["scale"], heading_of(turn_deg))


def test_pointer_below_a_fixed_mark_is_less_certain_also_where_it_resembles_its_reverse(
    over_numeral: PanelReader,
) -> None:
    """Its tip is told, but where it lies below the mark is not seen."""
    below = read_picture(over_numeral, with_arrow(117.0, 270.0, 327)).readings["bearing_deg"]

    assert below.status is Status.EDGE
    assert below.angle_deg == pytest.approx(270.0, abs=0.3)
    assert below.sigma_deg > 1.0  # 0.5 without what the mark hides


@pytest.mark.slow
def test_pointer_whose_tip_is_hidden_in_the_panel_picture_has_no_value() -> None:
    """Frames show how its ends differ, but not which of them it was drawn by: it may point either way."""
    assert arrows_off_deg(arrow_reader(270.0)) == []


@pytest.mark.parametrize("turn_deg", [20.0, 251.0])
def test_bug_that_is_not_there_is_missing(bugged: PanelReader, turn_deg: float) -> None:
    """No mark of the card is taken for it."""
    assert read_picture(bugged, with_bug(turn_deg, None, 7)).readings["bug_deg"].status is Status.MISSING


def test_bug_is_drawn_where_the_card_has_taken_it() -> None:
    """Its line follows the card; without a heading its place is unknown."""
    gauge = Gauge.model_validate({"centre": [104.4, 94.7], **copy.deepcopy(BUG)})
    lines = gauge.lines({"heading_deg": 350.0, "bug_deg": 5.0})

    assert [quantity.name for quantity in gauge.quantities] == ["heading_deg", "bug_deg"]
    assert lines["bug_deg"] is not None
    assert lines["bug_deg"][0][0] % 360.0 == pytest.approx(INDEX_DEG + 15.0)
    assert gauge.lines({"heading_deg": float("nan"), "bug_deg": 5.0})["bug_deg"] is None
