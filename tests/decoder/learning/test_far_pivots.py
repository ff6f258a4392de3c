"""Centres drawn far from where needles and cards turn: pivots are found, or stay as drawn."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.imaging.unwrapping import UnwrappedGauge
from decoder.instruments.appearance import Instrument
from decoder.instruments.kind_table import kind_of
from decoder.instruments.panel_reader import read_picture, unwrapped
from decoder.instruments.reading import Status
from decoder.learning.drawn_points import log_odds_of_scales, seen_from
from decoder.learning.fit import FittedReader, around_pivots, fit_to_flight
from decoder.learning.pivot_path import PivotPath
from decoder.panel.arrays import Floats
from decoder.panel.errors import PanelError
from decoder.panel.gauge import Gauge
from decoder.panel.scale import Scale
from tests.decoder.instruments import altimeters
from tests.decoder.instruments import test_cards as cards
from tests.decoder.instruments import test_over_card as over_card
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, paint, reader_for

Draws = Callable[[float, float], dict[str, Any]]

RADIUS_PX = 70.0
PANEL_DEG = 200.0
GAUGE: dict[str, Any] = {
    "name": "speed",
    "radius": [20, 70],
    "sweep": [120, 420],
    "scale": [[120, 0], [420, 300]],
    "needles": [{"name": "speed_kt", "template": {"at": PANEL_DEG, "span": 16}}],
}
TICKS_DEG = [120.0 + 25 * mark for mark in range(13)]


def draw(angle_deg: float, seed: int = 0) -> Any:  # noqa: ANN401 - a picture
    """A dial with numerals' worth of marks and a tapered needle."""

    def what(canvas: Any) -> None:  # noqa: ANN401
        canvas.dial(TICKS_DEG)
        for mark in range(12):
            canvas.bar(132.0 + 25 * mark, (44.0, 52.0), (3.0, 3.0), 120.0)
        canvas.hand(Hand(), angle_deg)

    return paint(what, seed=seed)


def drawn_beside(gauge: dict[str, Any], part: float, towards_deg: float) -> dict[str, Any]:
    """The gauge with its centre a part of the radius off."""
    towards = math.radians(towards_deg)
    far_px = part * gauge["radius"][1]
    return {**gauge, "centre": [CENTRE[0] + far_px * math.cos(towards), CENTRE[1] + far_px * math.sin(towards)]}


def fitted_to(angles_deg: np.ndarray[Any, np.dtype[np.float64]], part: float, towards_deg: float) -> FittedReader:
    """Fit to a flight with the needle at these angles, its centre drawn a part of the radius off."""
    frames = [draw(angle_deg, 50 + seed) for seed, angle_deg in enumerate(angles_deg.tolist())]
    return fit_to_flight(reader_for([drawn_beside(GAUGE, part, towards_deg)], draw(PANEL_DEG, 1)), lambda _: frames)


@pytest.mark.parametrize(("part", "towards_deg"), [(0.1, 20.0), (0.05, 110.0), (0.1, 250.0)])
def test_needle_turns_where_it_turns_however_its_centre_is_drawn(part: float, towards_deg: float) -> None:
    """A tenth of the radius off, the pivot is found, and readings are as good as those of a panel that is right."""
    fitted = fitted_to(np.linspace(125, 415, 16), part, towards_deg)

    assert beside_px(fitted, part, towards_deg) < 0.3
    for angle_deg in (150.0, 260.0, 330.0, 400.0):
        reading = read_picture(fitted.reader, draw(angle_deg, 9)).readings["speed_kt"]
        assert reading.status is Status.READ
        assert reading.angle_deg == pytest.approx(angle_deg, abs=0.6)


def beside_px(fitted: FittedReader, part: float, towards_deg: float) -> float:
    """How far from the true pivot the one of the speed is that was found, its centre drawn a part of the radius off."""
    drawn, moved = drawn_beside(GAUGE, part, towards_deg)["centre"], fitted.moved_px.get("speed", (0.0, 0.0))
    return math.dist(np.add(drawn, moved), CENTRE)


def alike(canvas: Canvas, angles_deg: tuple[float, float]) -> None:
    """Two hands of one form, as an engine instrument of a twin has them."""
    canvas.hand(Hand(level=170.0), angles_deg[0])
    canvas.hand(Hand(), angles_deg[1])


def short_and_at_the_rim(canvas: Canvas, angles_deg: tuple[float, float]) -> None:
    """A short hand and one of which only the end near the rim shows, as a clock's hour and second hands."""
    canvas.hand(Hand(tip=36.0), angles_deg[0])
    canvas.bar(angles_deg[1], (46.0, 66.0), (1.5, 1.5), 230.0)


@pytest.mark.parametrize(
    ("hands", "inner_px", "part", "towards_deg"),
    [
        (alike, 20, 0.05, 30.0),
        (alike, 20, 0.1, 200.0),
        (short_and_at_the_rim, 12, 0.08, 30.0),
        (short_and_at_the_rim, 12, 0.08, 200.0),
    ],
)
def test_two_hands_tell_their_pivot(
    hands: Callable[[Canvas, tuple[float, float]], None], inner_px: float, part: float, towards_deg: float
) -> None:
    """Each may be either, or no circle crosses both: but what moves lies along lines that cross at one point only."""
    needles = [
        {"name": "one", "template": {"at": 160.0, "span": 16}} | ({"covered_by": "other"} if hands is alike else {}),
        {"name": "other", "template": {"at": 330.0, "span": 16}},
    ]
    gauge = drawn_beside({**GAUGE, "radius": [inner_px, 70], "needles": needles}, part, towards_deg)

    def picture(angles_deg: tuple[float, float], seed: int) -> GreyPicture:
        return paint(lambda canvas: (canvas.dial(TICKS_DEG), hands(canvas, angles_deg)), seed=seed)

    turns_deg = [(260.0 + 130.0 * math.sin(0.9 * step), 270.0 + 130.0 * math.cos(0.7 * step)) for step in range(16)]
    frames = [picture(angles_deg, 50 + seed) for seed, angles_deg in enumerate(turns_deg)]
    fitted = fit_to_flight(reader_for([gauge], picture((160.0, 330.0), 1)), lambda _: frames)

    assert beside_px(fitted, part, towards_deg) < 0.8


@pytest.mark.parametrize("beside_deg", [0.0, 90.0, 225.0])
def test_needle_that_hardly_turns_does_not_lead_its_centre_away(beside_deg: float) -> None:
    """It tells too little of where it turns; the centre gets hardly worse than it was drawn."""
    fitted = fitted_to(np.linspace(195.0, 205.0, 16), 0.06, PANEL_DEG + beside_deg)

    assert beside_px(fitted, 0.06, PANEL_DEG + beside_deg) < 0.08 * RADIUS_PX


def test_centre_stays_where_no_needle_tells_another() -> None:
    """A needle that stands still, and one that turns about a correctly drawn centre, move nothing."""
    assert not fitted_to(np.full(16, PANEL_DEG), 0.08, 20.0).moved_px
    assert not fitted_to(np.linspace(125, 415, 16), 0.0, 0.0).moved_px


def test_marks_are_taken_to_be_drawn_as_carelessly_as_centres() -> None:
    """If a centre turns out to be drawn far from its pivot, its scale makes readings less certain."""
    angles_deg = np.linspace(125, 415, 16)
    careful, careless = (fitted_to(angles_deg, part, 20.0).uncertainties["speed_kt"] for part in (0.0, 0.06))

    assert careless.drawn_deg > 2 * careful.drawn_deg


@pytest.mark.slow
def test_card_is_read_however_its_centre_is_drawn() -> None:
    """Eight hundredths of the radius off, a heading is read in all frames."""
    turns_deg = [3.0 + 22.5 * step for step in range(16)]
    frames = [cards.draw(turn_deg, 100 + seed) for seed, turn_deg in enumerate(turns_deg)]
    gauge = drawn_beside(cards.CARD, 0.08, 20.0)
    fitted = fit_to_flight(reader_for([gauge], cards.draw(cards.PANEL_TURN_DEG, 1)), lambda _: frames)

    assert math.hypot(*fitted.moved_px["heading"]) == pytest.approx(0.08 * RADIUS_PX, abs=0.5)
    for turn_deg in (10.0, 100.0, 190.0, 320.0):
        status, off, _ = cards.off_deg(fitted.reader, cards.draw(turn_deg, 7), turn_deg)
        assert status is Status.READ
        assert off < 0.6


def clicked(part: float, towards_deg: float) -> dict[str, Any]:
    """The gauge as clicked by a hand that misses the centre by a part of the radius: its marks are points."""
    gauge = drawn_beside(GAUGE, part, towards_deg)
    missed_px = gauge["centre"][0] - CENTRE[0], gauge["centre"][1] - CENTRE[1]
    around = partial(seen_from, missed_px, RADIUS_PX)
    needle = {**GAUGE["needles"][0], "template": {"at": around(PANEL_DEG), "span": 16}}
    scale = [[around(angle_deg), value] for angle_deg, value in [[120, 0], [220, 100], [320, 200], [420, 300]]]
    return {**gauge, "sweep": [around(120), around(420)], "scale": scale, "needles": [needle]}


def as_often(gauge: dict[str, Any], towards_deg: float, drawn: Draws) -> list[dict[str, Any]]:
    """As many gauges as a small panel has, each missed to another side: here they lie on one dial."""
    towards = [towards_deg, towards_deg + 180.0, towards_deg + 30.0, towards_deg + 200.0]
    return [
        {**each, "name": f"{name}{index}", "needles": [{**each["needles"][0], "name": f"speed_{index}"}]}
        for index, each in enumerate(drawn(0.08, towards_deg) for towards_deg in towards)
        for name in [gauge["name"]]
    ]


@pytest.mark.parametrize("drawn", [clicked, partial(drawn_beside, GAUGE)], ids=["points", "angles"])
def test_marks_are_right_whether_they_are_points_or_angles(drawn: Draws) -> None:
    """The needles in the panel picture show which of the two a hand drew that missed the centres."""
    frames = [draw(angle_deg, 50 + seed) for seed, angle_deg in enumerate(np.linspace(125, 415, 16).tolist())]
    fitted = fit_to_flight(reader_for(as_often(GAUGE, 110.0, drawn), draw(PANEL_DEG, 1)), lambda _: frames)

    for gauge in fitted.panel.gauges:
        off, sigma = offs(fitted, gauge)
        assert np.abs(off).max() < 1.0
        assert (np.abs(off) < 1.96 * sigma).all()
        assert fitted.findings[gauge.name][0].endswith(
            "corrected with its marks: draw it there with `decode setup`"
        ) == (drawn is clicked)


@pytest.mark.parametrize("towards_deg", [20.0, 180.0])
@pytest.mark.parametrize("drawn", [clicked, partial(drawn_beside, GAUGE)], ids=["points", "angles"])
def test_marks_of_a_lone_gauge_may_be_points_or_angles(drawn: Draws, towards_deg: float) -> None:
    """One needle is too few to decide; sigma covers both."""
    frames = [draw(angle_deg, 50 + seed) for seed, angle_deg in enumerate(np.linspace(125, 415, 16).tolist())]
    fitted = fit_to_flight(reader_for([drawn(0.08, towards_deg)], draw(PANEL_DEG, 1)), lambda _: frames)
    off, sigma = offs(fitted, fitted.panel.gauges[0])

    assert (np.abs(off) < 1.96 * sigma).sum() >= len(off) - 1


def offs(fitted: FittedReader, gauge: Gauge) -> tuple[Floats, Floats]:
    """Errors of values read at some angles, and their sigmas; a degree is worth one."""
    scale, (needle,) = Scale.of(gauge.scale), gauge.needles
    angles_deg = np.array([130.0, 200.0, 260.0, 330.0, 400.0])
    found = [read_picture(fitted.reader, draw(angle_deg, 9)).readings[needle.name] for angle_deg in angles_deg]
    assert all(reading.status is Status.READ for reading in found)
    seen_deg = np.array([reading.angle_deg for reading in found])
    sigma = np.hypot([reading.sigma_deg for reading in found], fitted.sigma_deg(needle.name, seen_deg))
    return scale.values_at(seen_deg) - (angles_deg - 120.0), sigma


@given(
    offset=st.tuples(st.floats(-10, 10), st.floats(-10, 10)),
    angle_deg=st.floats(-360, 720),
    radius_px=st.floats(30, 90),
)
def test_point_is_seen_from_elsewhere_and_back(offset: tuple[float, float], angle_deg: float, radius_px: float) -> None:
    """Seen from elsewhere it lies in the direction that analytic geometry gives, in the same turn."""
    x, y = (radius_px * at(math.radians(angle_deg)) - off for at, off in zip((math.cos, math.sin), offset, strict=True))
    seen_deg = seen_from(offset, radius_px, angle_deg)

    assert math.cos(math.radians(seen_deg)) * math.hypot(x, y) == pytest.approx(x, abs=1e-9)
    assert math.sin(math.radians(seen_deg)) * math.hypot(x, y) == pytest.approx(y, abs=1e-9)
    assert abs(seen_deg - angle_deg) < 90


@pytest.mark.parametrize("towards_deg", [20.0, 250.0])
@pytest.mark.parametrize("drawn", [clicked, partial(drawn_beside, GAUGE)], ids=["points", "angles"])
def test_even_scale_tells_points_from_angles(drawn: Draws, towards_deg: float) -> None:
    """A circle's marks are even only as seen from its centre; two marks, or an unmoved pivot, decide nothing."""
    gauge = reader_for([drawn(0.08, towards_deg)], draw(PANEL_DEG, 1)).source.panel.gauges[0]
    marks = tuple((120.0 + 50.0 * mark, 50.0 * mark) for mark in range(7))
    even = gauge.model_copy(update={"scale": marks})
    offset_px = CENTRE[0] - gauge.centre[0], CENTRE[1] - gauge.centre[1]
    if drawn is clicked:
        even = even.at_angles(partial(seen_from, (-offset_px[0], -offset_px[1]), RADIUS_PX))
    moved = PivotPath(far_px=offset_px)
    ends = even.model_copy(update={"scale": (even.scale[0], even.scale[-1])})

    assert (log_odds_of_scales(even, moved) > 0.0) == (drawn is clicked)
    assert abs(log_odds_of_scales(even, moved)) > 3.0
    assert log_odds_of_scales(ends, moved) == pytest.approx(0.0)
    assert log_odds_of_scales(even, PivotPath()) == pytest.approx(0.0)


def test_hands_of_an_altimeter_are_read_around_a_centre_that_is_far_off() -> None:
    """Its ten marks and its hands are clicked, and its centre is missed by a tenth of the radius."""
    towards, radius_px = math.radians(160.0), altimeters.ALTIMETER["radius"][1]
    missed_px = (0.1 * radius_px * math.cos(towards), 0.1 * radius_px * math.sin(towards))
    around = partial(seen_from, missed_px, radius_px)
    needles = copy.deepcopy(altimeters.ALTIMETER["needles"])
    for needle in needles:
        needle["template"]["at"] = around(needle["template"]["at"])
        if "scale" in needle:
            needle["scale"] = ring_of_marks(needle["wraps"], around)
    gauge = altimeters.ALTIMETER | {
        "centre": [CENTRE[0] + missed_px[0], CENTRE[1] + missed_px[1]],
        "scale": ring_of_marks(1000.0, around),
        "needles": needles,
    }
    flown_ft = np.random.default_rng(5).uniform(0, 99_999, 17).tolist()
    *frames, last = [
        altimeters.drawn(altimeters.angles_of(feet), seed=100 + seed) for seed, feet in enumerate(flown_ft)
    ]

    fitted = fit_to_flight(reader_for([gauge], altimeters.drawn(altimeters.PANEL_DEG, seed=1)), lambda _: frames)

    found = read_picture(fitted.reader, last).readings["altitude_ft"]
    assert found.status is Status.READ
    assert fitted.moved_px["altimeter"] == pytest.approx([-each for each in missed_px], abs=1.0)


def ring_of_marks(turn: float, around: Callable[[float], float]) -> list[list[float]]:
    """Ten marks all round, as they are clicked."""
    return [[around(270.0 + 36.0 * number), turn / 10 * number] for number in range(10)]


def over_still_card(
    needle_deg: Callable[[int], float], towards_deg: float
) -> tuple[Instrument, Sequence[UnwrappedGauge]]:
    """A needle with its tail over a card that stands still, its centre drawn off, and its gauge in 16 frames."""
    frames = [over_card.with_pointer(cards.PANEL_TURN_DEG, needle_deg(step), 200 + step) for step in range(16)]
    reader = reader_for([drawn_beside(over_card.POINTER, 0.04, towards_deg)], frames[0])
    (gauge,), (grid,) = reader.source.panel.gauges, reader.grids
    strips = [frame.gauges[0] for frame in unwrapped(reader, frames) if frame.gauges[0] is not None]
    return Instrument(0, gauge, grid, strips[0]), strips


@pytest.mark.slow
@pytest.mark.parametrize("towards_deg", [20.0, 250.0])
def test_needle_that_reaches_across_its_pivot_tells_where_that_is(towards_deg: float) -> None:
    """What shows on the far side of the centre lies on the same line, on both sides of a part that is not sampled."""
    instrument, strips = over_still_card(lambda step: 40.0 + 51.0 * step, towards_deg)

    found = kind_of(instrument.gauge).far_pivot(instrument, strips)

    towards = math.radians(towards_deg)
    assert instrument.grid.tail_columns > 0
    assert found == pytest.approx(
        (-0.04 * RADIUS_PX * math.cos(towards), -0.04 * RADIUS_PX * math.sin(towards)), abs=0.4
    )


def test_card_that_stands_still_below_a_needle_does_not_show_from_where_it_is_seen() -> None:
    """A squeeze that makes the needle look alike wherever it points says nothing of the card."""
    instrument, strips = over_still_card(lambda step: 200.0 + 40.0 * math.sin(0.8 * step), 250.0)

    assert kind_of(instrument.gauge).squeeze(instrument, strips, is_lost=True) is None


@pytest.mark.slow
def test_rim_of_a_dial_whose_centre_is_drawn_beside_its_pivot_is_no_perspective() -> None:
    """The side to which the centre is off seems to be further away, until the card shows where it turns."""
    around = np.radians(np.arange(0.0, 360.0, 45.0))
    rim = (np.array(CENTRE) + 72.0 * np.stack([np.cos(around), np.sin(around)], axis=1)).tolist()
    gauge = drawn_beside({**cards.CARD, "rim": rim}, 0.04, 70.0)
    frames = [cards.draw(3.0 + 22.5 * step, 100 + step) for step in range(16)]
    reader = reader_for([gauge], cards.draw(cards.PANEL_TURN_DEG, 1))

    fitted = fit_to_flight(reader, lambda _: frames)

    (before,), (after,) = (np.array(each.source.planes) for each in (reader, fitted.reader))
    assert after.perspective < 0.1 * before.perspective
    for turn_deg in (31.0, 44.4, 140.0, 300.0):
        reading = read_picture(fitted.reader, cards.draw(turn_deg, 9)).readings["heading_deg"]
        (value,) = Scale.of(fitted.panel.gauges[0].scale, 360.0).values_at(np.array([reading.angle_deg]))
        assert reading.status is Status.READ
        assert cards.apart(float(value), cards.heading_of(turn_deg)) < 0.3


def test_needle_that_does_not_show_around_a_moved_pivot_is_missing() -> None:
    """A search may go astray on one dial: where its needle was drawn is nothing then, and the flight goes on."""

    def bare(angle_deg: float, seed: int) -> Any:  # noqa: ANN401 - a picture
        return paint(lambda canvas: (canvas.dial([]), canvas.hand(Hand(), angle_deg)), noise=0.5, seed=seed)

    reader = reader_for([GAUGE], bare(PANEL_DEG, 1))
    moved = around_pivots(reader, [(25.0, -25.0)], drawn=reader.source.panel.gauges)

    assert {read_picture(moved, bare(at, 3)).readings["speed_kt"].status for at in (150.0, PANEL_DEG)} == {
        Status.MISSING
    }


def test_dial_at_the_border_whose_pivot_is_moved_out_of_the_picture_does_not_end_the_flight() -> None:
    """Only what is drawn beyond the border is the panel's fault, and of two hands the one outside shows nothing."""
    hands = [*GAUGE["needles"], {"name": "bug_kt", "template": {"at": 270.0, "span": 16}}]
    at_border = {**GAUGE, "radius": [20, CENTRE[1] - 1], "needles": hands}
    reader = reader_for([at_border], draw(PANEL_DEG, 1))

    moved = around_pivots(reader, [(0.0, -6.0)], drawn=reader.source.panel.gauges)

    assert len(read_picture(moved, draw(150.0, 3)).readings) == len(hands)
    with pytest.raises(PanelError, match="outside"):
        reader_for([{**at_border, "centre": [CENTRE[0], CENTRE[1] - 6.0]}], draw(PANEL_DEG, 1))
