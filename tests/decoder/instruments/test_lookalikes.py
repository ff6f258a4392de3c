"""Nothing but a needle's tip is read for it: not its tail, a bug or line of its brightness, or a stop beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Status
from tests.decoder.instruments import altimeters
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, paint, reader_for

Draw = Callable[..., GreyPicture]
SWEEPS = {"arc": (120.0, 420.0), "circle": (270.0, 630.0)}
TIP_PX = 64.0


def draw_with(tail_px: float) -> Draw:
    """Makes a function that draws a dial with a needle as wide at its tip as at the end of its tail."""
    form = Hand(tip=TIP_PX, tail=tail_px, root_half=2.6, tip_half=2.6, tail_half=2.6)

    def draw(angle_deg: float, seed: int = 0) -> GreyPicture:
        return paint(lambda canvas: (canvas.dial(range(0, 360, 30)), canvas.hand(form, angle_deg)), seed=seed)

    return draw


def reader_with(tail_px: float, sweep: tuple[float, float], *, tail: bool) -> PanelReader:
    """A tuned reader of such a dial."""
    draw, (first, last) = draw_with(tail_px), sweep
    gauge = {
        "name": "rpm",
        "radius": [20, 66],
        "sweep": list(sweep),
        "tail": tail,
        "scale": [[first, 0], [last, 300]],
        "needles": [{"name": "rpm", "template": {"at": 214.0, "span": 16}}],
    }
    frames = [draw(first + 3.0 + (last - first) * step / 16, 100 + step) for step in range(16)]
    return reader_for([gauge], draw(214.0, 1), frames)


@pytest.mark.parametrize("sweep", SWEEPS.values(), ids=SWEEPS)
@pytest.mark.parametrize(("tail_px", "tail"), [(30.0, True), (60.0, True), (45.0, False)])
def test_tip_is_read_whatever_the_tail(tail_px: float, sweep: tuple[float, float], *, tail: bool) -> None:
    """A tail with the needle's width and brightness is not its tip at any angle; a shorter one even without the key."""
    reader, draw = reader_with(tail_px, sweep, tail=tail), draw_with(tail_px)
    angles_deg = np.random.default_rng(5).uniform(*sweep, 20)
    readings = [read_picture(reader, draw(angle, seed)).readings["rpm"] for seed, angle in enumerate(angles_deg)]
    errors = [apart(reading.angle_deg, angle) for reading, angle in zip(readings, angles_deg, strict=True)]

    assert {reading.status for reading in readings} == {Status.READ}
    assert np.mean(errors) < 0.1
    assert max(errors) < 0.4


def draw_vibrating(angle_deg: float, seed: int, most_px: float = 2.5) -> GreyPicture:
    """An arrow with a tail as long as its tip, on a dial that vibration shows some pixels aside."""
    aside_px = np.random.default_rng(1000 + seed).uniform(-most_px, most_px, 2)
    centre = (CENTRE[0] + float(aside_px[0]), CENTRE[1] + float(aside_px[1]))
    form = Hand(tip=58.0, tail=58.0, root_half=4.5, tip_half=1.6, tail_half=3.0, centre=centre)

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 30), centre)
        canvas.hand(form, angle_deg)
        canvas.bar(angle_deg, (47.0, 57.0), (4.5, 0.5), form.level, centre)

    return paint(what, seed=seed)


@pytest.mark.parametrize("tail_level", [45.0, 60.0])
def test_a_bright_tip_and_a_dark_tail_show_where_a_needle_points(tail_level: float) -> None:
    """A compass needle whose ends differ by more than they share, which had been missing in all frames."""
    tip = Hand(tip=TIP_PX, root_half=7.0, tip_half=0.8)

    def draw(angle_deg: float, seed: int) -> GreyPicture:
        def what(canvas: Canvas) -> None:
            canvas.dial(range(0, 360, 30))
            canvas.hand(replace(tip, level=tail_level), angle_deg + 180.0)
            canvas.hand(tip, angle_deg)

        return paint(what, seed=seed)

    gauge = {
        "name": "compass",
        "radius": [14, 60],
        "sweep": [270, 630],
        "tail": True,
        "scale": [[270, 0], [450, 180]],
        "wraps": 360,
        "needles": [{"name": "compass_deg", "template": {"at": 340.0, "span": 30}}],
    }
    reader = reader_for([gauge], draw(340.0, 1), [draw(270.0 + 22.5 * step, 100 + step) for step in range(16)])
    for seed, angle_deg in enumerate(np.arange(275.0, 630.0, 31.0).tolist()):
        reading = read_picture(reader, draw(angle_deg, seed)).readings["compass_deg"]
        assert reading.status is Status.READ
        assert apart(reading.angle_deg, angle_deg) < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_vibration_turns_no_needle_around(seed: int) -> None:
    """Cut a pixel or two beside the centre, a needle resembles its reverse more than itself on the other side."""
    gauge = {
        "name": "bearing",
        "radius": [15, 60],
        "sweep": [270, 630],
        "tail": True,
        "wraps": 360,
        "scale": [[270, 0], [630, 360]],
        "needles": [{"name": "bearing_deg", "template": {"at": 312.0, "span": 16}}],
    }
    # It is seen about one bearing most of the time.
    bearings_deg = np.random.default_rng(seed).normal(350.0, 25.0, 40).tolist()
    frames = [draw_vibrating(each, 100 * seed + number) for number, each in enumerate(bearings_deg[:16])]
    reader = reader_for([gauge], draw_vibrating(312.0, 7000 + seed), frames)

    shown = enumerate(bearings_deg[16:])
    found = [
        (read_picture(reader, draw_vibrating(each, 5000 + 100 * seed + number)).readings["bearing_deg"], each)
        for number, each in shown
    ]

    assert [
        each for reading, each in found if reading.status is Status.READ and apart(reading.angle_deg, each) > 90
    ] == []


GAUGE: dict[str, Any] = {
    "name": "itt",
    "radius": [20, 66],
    "sweep": [120, 420],
    "scale": [[120, 0], [420, 300]],
    "needles": [{"name": "itt_c", "template": {"at": 214.0, "span": 16}}],
}
# Radii and half width of a bug, and how far either half of it lies from its middle in degrees.
BUGS = {
    "block": ((58, 70), 3.5, 0.0),
    "vee": ((58, 70), 2.0, 3.5),
    "line": ((40, 70), 1.4, 0.0),
    "long line": ((22, 70), 1.6, 0.0),
}


def band(canvas: Any, first_deg: float, last_deg: float) -> None:  # noqa: ANN401
    """A coloured arc at the rim, in grey as bright as the needle."""
    turn = np.radians(np.arange(first_deg, last_deg + 0.5, 0.5))
    outer, inner = ([(CENTRE[0] + r * np.cos(a), CENTRE[1] + r * np.sin(a)) for a in turn] for r in (66, 60))
    canvas.polygon([*outer, *inner[::-1]], 228)


def draw(angle_deg: float, bug_deg: float, kind: str, seed: int = 0) -> GreyPicture:
    """Draws a dial with a band, two fixed lines, a movable bug and the needle."""
    radii, half, apart_deg = BUGS[kind]

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 30))
        band(canvas, 200, 300)
        canvas.bar(300, (48, 72), (1.5, 1.5), 228)
        canvas.bar(156, (30, 72), (1.5, 1.5), 228)
        for side in (-apart_deg, apart_deg):
            canvas.bar(bug_deg + side, radii, (half, half), 225)
        canvas.hand(Hand(tip=66.0), angle_deg)

    return paint(what, seed=seed)


@pytest.fixture(scope="module", params=list(BUGS))
def kind(request: pytest.FixtureRequest) -> str:
    """Each form of a bug."""
    return str(request.param)


@pytest.fixture(scope="module")
def reader(kind: str) -> PanelReader:
    """A reader tuned to frames with the bug anywhere."""
    rng = np.random.default_rng(5)
    frames = [draw(123.0 + 18.75 * step, rng.uniform(120, 420), kind, 100 + step) for step in range(16)]
    return reader_for([GAUGE], draw(214.0, 330.0, kind, 1), frames)


def test_bug_is_no_needle_wherever_it_is(reader: PanelReader, kind: str) -> None:
    """With the bug away from it the needle is read as if there were none; beside it, rightly or not at all."""
    rng = np.random.default_rng(6)
    away: list[float | None] = []
    beside: list[float | None] = []
    for seed, angle_deg in enumerate(rng.uniform(130, 410, 20).tolist()):
        for found, bug_deg in (
            (away, 120 + (angle_deg - 120 + rng.uniform(20, 280)) % 300),
            (beside, angle_deg + rng.uniform(-14, 14)),
        ):
            reading = read_picture(reader, draw(angle_deg, bug_deg, kind, seed)).readings["itt_c"]
            found.append(None if reading.status is Status.MISSING else abs(reading.angle_deg - angle_deg))

    assert away.count(None) <= 1
    assert max(off for off in away + beside if off is not None) < 0.01 * 300.0
    assert np.mean([off for off in away if off is not None]) < 0.1
    assert kind not in {"block", "vee"} or None not in beside  # those stand at the rim alone


PRESSURE: dict[str, Any] = {
    "name": "pressure",
    "radius": [20, 66],
    "sweep": [135, 405],
    "stops": [118, 418],
    "unit": "psi",
    "scale": [[135, 0], [270, 50], [405, 200]],
    "needles": [{"name": "oil_psi", "template": {"at": 214.0, "span": 16}}],
}


def pressure(angle_deg: float, seed: int = 0) -> GreyPicture:
    """Draws the dial."""
    return paint(lambda canvas: (canvas.dial(range(135, 406, 27)), canvas.hand(Hand(), angle_deg)), seed=seed)


@pytest.fixture(scope="module")
def stopped() -> PanelReader:
    """Its reader, tuned to a flight in which the needle never leaves the scale."""
    return reader_for([PRESSURE], pressure(214.0, 1), [pressure(140.0 + 17 * step, 20 + step) for step in range(16)])


@pytest.mark.parametrize("angle_deg", [115.0, 124.0, 135.0, 222.2, 333.3, 405.0, 421.0])
def test_needle_is_read_from_stop_to_stop(stopped: PanelReader, angle_deg: float) -> None:
    """On its stops, a little beyond them, and on the scale."""
    reading = read_picture(stopped, pressure(angle_deg, 3)).readings["oil_psi"]

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.2)


def test_needle_beyond_its_stops_is_missing(stopped: PanelReader) -> None:
    """The nearest stop is not read instead, nor is a needle at rest read if the panel has no stops."""
    unknowing = reader_for([{key: own for key, own in PRESSURE.items() if key != "stops"}], pressure(214.0, 1))

    for reader, angle_deg in ((stopped, 76.0), (stopped, 108.0), (unknowing, 118.0)):
        assert read_picture(reader, pressure(angle_deg, 3)).readings["oil_psi"].status is Status.MISSING


def draw_aeroplane(turned_deg: float, seed: int = 0) -> GreyPicture:
    """Draws a turn coordinator: an aeroplane with two wings alike, before marks and print that stand still."""

    def what(canvas: Canvas) -> None:
        canvas.dial([0.0, 20.0, 160.0, 180.0])
        canvas.bar(90.0, (30, 44), (24, 20), 200.0)
        for wing_deg in (0.0, 180.0):
            canvas.bar(turned_deg + wing_deg, (0.0, 58.0), (2.2, 1.4), 230.0)
        canvas.bar(turned_deg - 90.0, (0.0, 16.0), (1.2, 1.2), 230.0)
        canvas.disc(CENTRE, 7.0, 230.0)

    return paint(what, seed=seed)


def test_symbol_with_two_wings_alike_is_read_by_both_within_its_sweep() -> None:
    """An aeroplane that never turns over is a needle with a tail: the sweep distinguishes its wings."""
    gauge = {
        "name": "turn",
        "radius": [20, 62],
        "sweep": [-60, 60],
        "tail": True,
        "scale": [[-60, -3], [60, 3]],
        "needles": [{"name": "rpm", "template": {"at": 8.0, "span": 16}}],
    }
    frames = [draw_aeroplane(28.0 * np.sin(step), 100 + step) for step in range(16)]
    reader = reader_for([gauge], draw_aeroplane(8.0, 1), frames)

    for number, turned_deg in enumerate([-55.0, -31.0, -20.0, -0.4, 0.0, 12.3, 20.0, 44.0]):
        reading = read_picture(reader, draw_aeroplane(turned_deg, number)).readings["rpm"]
        assert reading.status is Status.READ
        assert apart(reading.angle_deg, turned_deg) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize(("level", "least"), [(165.0, 0.85), (230.0, 0.0)], ids=["another tone", "the same"])
@pytest.mark.parametrize("below", [{}, {"covered_by": "one"}], ids=["beside", "below"])
def test_two_needles_of_one_form_are_never_taken_for_each_other(
    level: float, least: float, below: dict[str, str]
) -> None:
    """Each matches the other by shape; only their tones distinguish them, also in less light than they had."""

    def draw(one_deg: float, other_deg: float, seed: int, gain: float = 1.0) -> GreyPicture:
        def what(canvas: Canvas) -> None:
            canvas.dial(range(0, 360, 30))
            canvas.hand(Hand(level=level), other_deg)
            canvas.hand(Hand(), one_deg)

        return (paint(what, seed=seed).astype(np.float32) * gain).round().astype(np.uint8)

    rng = np.random.default_rng(9)
    drawn = [
        {"name": "one", "template": {"at": 160.0, "span": 16}},
        {"name": "other", "template": {"at": 330.0, "span": 16}, **below},
    ]
    gauge = {"name": "volts", "radius": [20, 66], "sweep": [120, 420], "scale": [[120, 0], [420, 30]], "needles": drawn}
    flown = [draw(*rng.uniform(125, 415, 2), 100 + index) for index in range(16)]
    reader = reader_for([gauge], draw(160.0, 330.0, 1), flown)
    pairs = [(one, one + apart_deg) for one in (130.0, 200.0, 270.0) for apart_deg in (9.0, 40.0, 75.0, 140.0)]
    pairs += [(other, one) for one, other in pairs]

    read = 0
    for seed, angles_deg in enumerate(pairs):
        readings = read_picture(reader, draw(*angles_deg, seed, gain=0.7)).readings
        for name, angle_deg in zip(("one", "other"), angles_deg, strict=True):
            off = apart(readings[name].angle_deg, angle_deg)
            read += readings[name].status is Status.READ
            assert readings[name].status is Status.MISSING or off < max(1.0, 2.0 * readings[name].sigma_deg)
    assert read >= least * 2 * len(pairs)


def bright_over_dim(bright_deg: float, dim_deg: float, seed: int) -> GreyPicture:
    """A dial with a bright needle over a dim one of the same shape."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 30))
        canvas.hand(Hand(level=150.0), dim_deg)
        canvas.hand(Hand(), bright_deg)

    return paint(what, seed=seed)


@pytest.mark.parametrize("beside_deg", [0.0, 2.0], ids=["as drawn", "drawn beside its axis"])
def test_needle_found_where_the_other_is_goes_back_to_its_own_place(beside_deg: float) -> None:
    """Also if it is cut beside its axis, so that it does not lie exactly where it matched as the other."""
    needles = [
        {"name": "one", "template": {"at": 160.0, "span": 16}},
        {"name": "other", "template": {"at": 330.0 + beside_deg, "span": 16}, "covered_by": "one"},
    ]
    gauge = {"name": "n1", "radius": [20, 66], "sweep": [120, 420], "scale": [[120, 0], [420, 30]], "needles": needles}
    reader = reader_for([gauge], bright_over_dim(160.0, 330.0, 1))
    read = 0
    for seed, angles_deg in enumerate(np.random.default_rng(4).uniform(130, 410, (24, 2)), start=2):
        readings = read_picture(reader, bright_over_dim(*angles_deg.tolist(), seed)).readings
        for name, angle_deg in zip(("one", "other"), angles_deg, strict=True):
            read += readings[name].status is Status.READ
            off_deg = apart(readings[name].angle_deg, angle_deg)
            assert readings[name].status is not Status.READ or off_deg < beside_deg + 1.0
    assert read > 36


def drawn_hands(
    forms: Sequence[Hand], angles_deg: Sequence[float], seed: int, ticks_deg: Sequence[float] = range(120, 421, 30)
) -> GreyPicture:
    """A dial with hands, the lowest first."""

    def what(canvas: Canvas) -> None:
        canvas.dial(ticks_deg)
        for form, angle_deg in zip(forms, angles_deg, strict=True):
            canvas.hand(form, angle_deg)

    return paint(what, seed=seed)


def one_below_another(names: Sequence[str], drawn_deg: Sequence[float], spans: Sequence[float]) -> dict[str, Any]:
    """The needles of a gauge, the lowest first."""
    return {
        "needles": [
            {"name": name, "template": {"at": at, "span": span}} | ({"covered_by": above} if above else {})
            for name, at, span, above in zip(names, drawn_deg, spans, [*names[1:], ""], strict=True)
        ]
    }


ALIKE = (
    Hand(tip=40.0, root_half=2.6, tip_half=1.0),
    Hand(tip=52.0, root_half=2.6, tip_half=1.0, tail=20.0),
    Hand(tip=64.0, root_half=2.2, tip_half=1.0, tail=24.0),
)
"""The shortest below the others."""
THREE = {"name": "three", "radius": [14, 66], "sweep": [120, 420], "scale": [[120, 0], [420, 300]]}


@pytest.mark.slow
@pytest.mark.parametrize("middle_deg", [262.0, 330.0], ids=["cut with another", "cut by itself"])
def test_needles_that_differ_in_length_alone_are_not_exchanged(middle_deg: float) -> None:
    """One of three that took another's place gives it back or is missing, also if they were cut too near each other."""
    draw_three = partial(drawn_hands, ALIKE)
    names, drawn_deg = ("short", "middle", "long"), np.array([250.0, middle_deg, 170.0])
    rng = np.random.default_rng(8)
    frames = [draw_three(drawn_deg + rng.uniform(-5.0, 5.0, 3), 100 + number) for number in range(16)]
    gauge = THREE | one_below_another(names, drawn_deg.tolist(), (20, 20, 20))
    reader = reader_for([gauge], draw_three(drawn_deg, 1), frames)
    off_deg = []
    for number, angles_deg in enumerate(rng.uniform(125.0, 415.0, (24, 3))):
        readings = read_picture(reader, draw_three(angles_deg, 200 + number)).readings
        off_deg += [
            abs(readings[name].angle_deg - angle_deg)
            for name, angle_deg in zip(names, angles_deg, strict=True)
            if readings[name].status is Status.READ
        ]

    assert max(off_deg, default=0.0) < 1.0
    assert middle_deg != 330.0 or len(off_deg) > 20


def test_two_needles_alike_are_never_exchanged_where_their_pictures_end_within_the_hub() -> None:
    """Which of them is which cannot be told, however well the one drawn beside its axis fits where it was found."""
    draw = partial(drawn_hands, [Hand(tip=64.0, root_half=4.5, tip_half=0.5)] * 2)
    drawn_deg, rng = (170.0, 330.0), np.random.default_rng(6)
    gauge = (
        THREE | {"radius": [9, 66]} | one_below_another(("one", "other"), (drawn_deg[0] + 1.0, drawn_deg[1]), (16, 16))
    )
    frames = [draw(each, 100 + number) for number, each in enumerate(rng.uniform(125.0, 415.0, (16, 2)).tolist())]
    reader = reader_for([gauge], draw(drawn_deg, 1), frames)
    for number, angles_deg in enumerate(rng.uniform(125.0, 415.0, (24, 2)).tolist()):
        readings = read_picture(reader, draw(angles_deg, 200 + number)).readings
        for name, angle_deg in zip(("one", "other"), angles_deg, strict=True):
            assert readings[name].status is not Status.READ or apart(readings[name].angle_deg, angle_deg) < 3.0


@pytest.mark.parametrize("is_doubted", [False, True])
def test_two_needles_alike_that_most_frames_do_not_tell_apart_are_never_told_apart(*, is_doubted: bool) -> None:
    """Not even where one order fits clearly better: what differs may be a shadow, as one picture of each shows it."""
    needles = [
        {"name": "one", "template": {"at": 160.0, "span": 16}},
        {"name": "other", "template": {"at": 330.0, "span": 16}, "covered_by": "one"},
    ]
    gauge = {"name": "n1", "radius": [20, 66], "sweep": [120, 420], "scale": [[120, 0], [420, 30]], "needles": needles}
    reader = reader_for([gauge], bright_over_dim(160.0, 330.0, 1))
    if is_doubted:
        reader = reader.with_appearance(replace(reader.appearance, doubted=frozenset({"one", "other"})))
    readings = [
        read_picture(reader, bright_over_dim(at, at + 100.0, seed)).readings
        for seed, at in enumerate((150.0, 200.0, 300.0))
    ]
    statuses = {own[name].status for own in readings for name in ("one", "other")}

    assert statuses == {Status.MISSING if is_doubted else Status.READ}


def test_needles_that_differ_are_read_beside_a_third_that_is_not_there() -> None:
    """Nor does a bright bar on the dial make them doubtful: neither is taken for the third."""

    def draw_forms(angles_deg: Sequence[float], seed: int, bar_deg: float | None = None) -> GreyPicture:
        def what(canvas: Canvas) -> None:
            canvas.dial(range(120, 421, 30))
            for form, angle_deg in zip(altimeters.FORMS[-len(angles_deg) :], angles_deg, strict=True):
                canvas.hand(form, angle_deg)
            if bar_deg is not None:
                canvas.bar(bar_deg, (30, 55), (9, 9), 200)

        return paint(what, seed=seed)

    drawn_deg, names = (160.0, 250.0, 340.0), ("short", "wide", "long")
    reader = reader_for([THREE | one_below_another(names, drawn_deg, (24, 24, 24))], draw_forms(drawn_deg, 1))
    for number, turned_deg in enumerate(np.arange(0.0, 90.0, 9.0).tolist()):
        angles_deg = 230.0 + turned_deg, 310.0 + turned_deg
        readings = read_picture(reader, draw_forms(angles_deg, 20 + number, 140.0 if number % 2 else 405.0)).readings
        for name, angle_deg in zip(names[1:], angles_deg, strict=True):
            assert readings[name].status is Status.READ
            assert apart(readings[name].angle_deg, angle_deg) < 1.0


def bar_hand(tip_px: float, half_px: float, level: float = 230.0) -> Hand:
    """A hand as wide at its tip as at its root."""
    return Hand(tip=tip_px, root_half=half_px, tip_half=half_px, level=level)


TAPERED = Hand(tip=44.0, root_half=2.6, tip_half=2.2), Hand(tip=60.0, root_half=2.6, tip_half=2.2)
CLOCKS = {
    "two alike": ((bar_hand(60.0, 2.2), bar_hand(66.0, 2.2), bar_hand(66.0, 2.2, 120.0)), (1, 2, 3, 7)),
    "a thin one": ((*TAPERED, bar_hand(64.0, 1.6, 150.0)), (6, 20, 34)),
    "all three": ((bar_hand(54.0, 2.6), bar_hand(66.0, 2.2), bar_hand(66.0, 1.6, 160.0)), (10, 11, 12)),
}


@pytest.mark.parametrize(("forms", "times"), CLOCKS.values(), ids=CLOCKS)
def test_no_hand_of_a_clock_is_read_for_another(forms: Sequence[Hand], times: Sequence[int]) -> None:
    """Nor for one whose own place two others dispute, nor for what it covers, nor where all three are exchanged."""
    draw = partial(drawn_hands, forms, ticks_deg=())
    drawn_deg, names = (188.0, 70.0, 285.0), ("hour", "minute", "second")
    gauge = {"name": "clock", "radius": [13, 60], "sweep": [270, 630], "scale": [[270, 0], [450, 6]], "wraps": 12}
    gauge |= one_below_another(names, drawn_deg, (20, 18, 12))
    frames = [
        draw(each, 50 + at) for at, each in enumerate(np.random.default_rng(3).uniform(270, 630, (16, 3)).tolist())
    ]
    reader = reader_for([gauge], draw(drawn_deg, 1), frames)
    for time in times:
        angles_deg = 180.0 + 3.0 * time, 10.0 + 36.0 * time, 300.0 + 222.0 * time
        readings = read_picture(reader, draw(angles_deg, 200 + time)).readings
        for name, angle_deg in zip(names, angles_deg, strict=True):
            assert readings[name].status is not Status.READ or apart(readings[name].angle_deg, angle_deg) < 3.0
