"""Hands that tell one value are solved for it: hidden, dim, alike or in each other's way, and never a turn off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Reading, Status
from decoder.learning.fit import fit_to_flight
from tests.decoder.instruments.altimeters import ALTIMETER, FORMS, PANEL_DEG, TURNS_FT, angles_of, drawn
from tests.decoder.instruments.dials import CENTRE, Canvas, Hand, apart, paint, reader_for

Forms = Sequence[Hand]
SLIM_BELOW = (
    replace(FORMS[0], tip=34.0),
    replace(FORMS[1], root_half=2.0, tip_half=1.0),
    replace(FORMS[2], root_half=4.0),
)
"""The middle pointer is gone where it lies below the long one."""
ALIKE = (FORMS[0], replace(FORMS[2], tip=60.0), FORMS[2])
"""The middle pointer and the long one look the same, all but for four pixels."""
DIM = (replace(FORMS[0], level=75.0), replace(FORMS[1], level=80.0), FORMS[2])
"""Of the two lower pointers a fifth of the usual contrast is left."""
DARK_ABOVE = (*(replace(form, level=235.0) for form in FORMS[:2]), replace(FORMS[2], level=150.0))
"""The long pointer, above the others, is the darkest."""
TAILED = (*FORMS[:2], replace(FORMS[2], tail=26.0, tail_half=2.2))
KINDS: dict[str, Forms] = {
    "usual": FORMS,
    "slim below": SLIM_BELOW,
    "alike": ALIKE,
    "dim": DIM,
    "dark above": DARK_ABOVE,
    "tailed": TAILED,
}
ALTITUDES_FT = np.random.default_rng(19).uniform(0.0, 99_999.0, 24)
HALF_A_FINE_TURN_FT = 500.0


def learned(forms: Forms) -> PanelReader:
    """The reader of an altimeter, tuned to a flight up and down."""
    altitudes_ft = np.random.default_rng(5).uniform(0, 99_999, 16)
    frames = [drawn(angles_of(altitude_ft), forms, 100 + seed) for seed, altitude_ft in enumerate(altitudes_ft)]
    return reader_for([ALTIMETER | {"tail": forms[2].tail > 0}], drawn(PANEL_DEG, forms, 1), frames)


@pytest.fixture(scope="module")
def readers() -> dict[str, PanelReader]:
    """By kind of pointers."""
    return {name: learned(forms) for name, forms in KINDS.items()}


def altitude(reader: PanelReader, picture: GreyPicture) -> tuple[Reading, float]:
    """What is read of the value, and the value: a turn of its scale is 100,000 ft."""
    reading = read_picture(reader, picture).readings["altitude_ft"]
    return reading, reading.angle_deg / 360.0 * 100_000.0


@pytest.mark.slow
@given(altitude_ft=st.floats(0.0, 99_999.0), kind=st.sampled_from(sorted(KINDS)))
@example(altitude_ft=0.0, kind="alike")
@example(altitude_ft=1111.1, kind="slim below")
@example(altitude_ft=0.0, kind="tailed")
@example(altitude_ft=11_111.1, kind="dark above")
@example(altitude_ft=11_111.1, kind="alike")
@settings(max_examples=60)
def test_any_altitude_is_found_again_or_none_is(readers: dict[str, PanelReader], altitude_ft: float, kind: str) -> None:
    """What has a value is right to a few feet: never a turn of any pointer off."""
    reading, told_ft = altitude(readers[kind], drawn(angles_of(altitude_ft), KINDS[kind]))

    if reading.status is not Status.MISSING:
        assert apart(told_ft, altitude_ft, 100_000.0) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nearly_all_altitudes_have_a_value(readers: dict[str, PanelReader], kind: str) -> None:
    """Whatever the pointers look like: one that is not seen does not affect the others."""
    told = [
        altitude(readers[kind], drawn(angles_of(each), KINDS[kind], seed)) for seed, each in enumerate(ALTITUDES_FT)
    ]
    valued = [
        apart(told_ft, each, 100_000.0)
        for (reading, told_ft), each in zip(told, ALTITUDES_FT, strict=True)
        if reading.status is not Status.MISSING
    ]

    assert len(valued) >= 0.9 * len(ALTITUDES_FT)
    assert np.mean(valued) < 1.0


@pytest.mark.slow
def test_pointer_below_another_is_where_the_value_has_it(readers: dict[str, PanelReader]) -> None:
    """The middle pointer is completely below the long one: it is hidden, and the value is read."""
    altitude_ft = 51_111.1
    found = read_picture(readers["slim below"], drawn(angles_of(altitude_ft), SLIM_BELOW)).readings

    assert found["altitude_ft"].status is Status.READ
    assert found["thousands_ft"].status in (Status.HIDDEN, Status.EDGE)
    truth_deg = angles_of(altitude_ft)[list(TURNS_FT).index("thousands_ft")]
    assert apart(found["thousands_ft"].angle_deg, truth_deg) < 7.2


@pytest.mark.slow
def test_value_that_few_frames_show_needs_all_of_its_pointers(readers: dict[str, PanelReader]) -> None:
    """The visible pointer may be certain, but its own turns are not known."""
    reader, hides = readers["slim below"], drawn(angles_of(51_111.1), SLIM_BELOW)
    doubtful = frozenset({"thousands_ft", "altitude_ft"})
    dim, rare = (
        reader.with_appearance(replace(reader.appearance, doubted=each))
        for each in (doubtful - {"altitude_ft"}, doubtful)
    )

    assert altitude(dim, hides)[0].status is Status.READ
    assert altitude(rare, hides)[0].status is Status.MISSING
    assert altitude(rare, drawn(angles_of(23_456.0), SLIM_BELOW))[0].status is Status.READ


def _without(hand: int) -> Callable[[float], GreyPicture]:
    """An altimeter that has lost one of its pointers."""
    rest = [index for index in range(len(FORMS)) if index != hand]

    def picture(altitude_ft: float) -> GreyPicture:
        angles_deg = angles_of(altitude_ft)
        return drawn([angles_deg[index] for index in rest], [FORMS[index] for index in rest])

    return picture


def _with_another(altitude_ft: float) -> GreyPicture:
    """An altimeter with one more long pointer, which the panel does not know, a third of a turn on."""
    angles_deg = angles_of(altitude_ft)
    return drawn((*angles_deg, angles_deg[-1] + 120.0), (*FORMS, FORMS[-1]))


def _flat(_altitude_ft: float) -> GreyPicture:
    """A dial all of one grey."""
    picture = drawn(PANEL_DEG).copy()
    picture[10:180, 10:190] = 90
    return picture


def _ungeared(altitude_ft: float) -> GreyPicture:
    """An altimeter whose middle pointer is off by half of what lies between two of its marks."""
    low, middle, high = angles_of(altitude_ft)
    return drawn((low, middle + 18.0, high))


@pytest.mark.slow
@pytest.mark.parametrize(
    "picture",
    [_without(0), _without(1), _without(2), _with_another, _ungeared, _flat],
    ids=["no 10,000", "no 1000", "no 100", "one more", "not geared", "flat"],
)
def test_dial_that_does_not_add_up_tells_no_wrong_value(
    readers: dict[str, PanelReader], picture: Callable[[float], GreyPicture]
) -> None:
    """A pointer that is nowhere, one too many, or pointers that do not go together: in doubt there is no value."""
    for altitude_ft in ALTITUDES_FT[[not _may_hide(each) for each in ALTITUDES_FT]][:6]:
        reading, told_ft = altitude(readers["usual"], picture(altitude_ft))

        assert reading.status is Status.MISSING or apart(told_ft, altitude_ft, 100_000.0) < HALF_A_FINE_TURN_FT


def _may_hide(altitude_ft: float) -> bool:
    """Whether the lowest pointer would be below another at some altitude that fits the others."""
    _, *others = angles_of(altitude_ft)
    lowest = [angles_of(altitude_ft % 10_000.0 + turns * 10_000.0)[0] for turns in range(10)]
    return min(apart(one, other) for one in lowest for other in others) < 12.0


BROAD = (
    Hand(tip=36.0, root_half=7.0, tip_half=0.5, level=215.0),
    Hand(tip=46.0, root_half=4.0, tip_half=3.0, level=225.0),
    Hand(tip=64.0, root_half=2.2, tip_half=1.2, level=235.0),
)
"""The lowest pointer is broader at its hub than its template."""


def low(altitude_ft: float, seed: int = 0) -> GreyPicture:
    """An altimeter whose two upper pointers have dark tails that hide what is below them."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 36))
        for form, angle_deg in zip(BROAD, angles_of(altitude_ft), strict=True):
            if form is not BROAD[0]:
                canvas.bar(angle_deg, (-40.0, 0.0), (4.0, 4.0), 95.0)
            canvas.hand(form, angle_deg)
        canvas.disc(CENTRE, 9.0, 60.0)

    return paint(what, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("panel_ft", [1040.0, 2040.0])
def test_flight_in_which_the_coarsest_pointer_hardly_moves_is_read_from_any_picture(panel_ft: float) -> None:
    """It stays beside the others in the panel picture, and where their tails hide it: it is not taken for print."""
    altitudes_ft = np.random.default_rng(8).uniform(900.0, 3600.0, 40)
    at_deg = [270.0 + (angle_deg - 270.0) % 360.0 for angle_deg in angles_of(panel_ft)]
    needles = [
        {**needle, "template": {**needle["template"], "at": each}}
        for needle, each in zip(ALTIMETER["needles"], at_deg, strict=True)
    ]
    frames = [low(altitude_ft, seed) for seed, altitude_ft in enumerate(altitudes_ft[:16], start=1)]
    reader = fit_to_flight(reader_for([{**ALTIMETER, "needles": needles}], low(panel_ft)), lambda _: frames).reader
    read = [
        (*altitude(reader, low(altitude_ft, 50 + seed)), altitude_ft)
        for seed, altitude_ft in enumerate(altitudes_ft[16:].tolist())
    ]
    off_ft = [
        apart(told_ft, truth_ft, 100_000.0)
        for reading, told_ft, truth_ft in read
        if reading.status is not Status.MISSING
    ]

    assert len(off_ft) >= 0.6 * len(read)
    assert max(off_ft) < 10.0


TWO_POINTERS = ALTIMETER | {
    "combined": {"name": "altitude_ft", "needles": ["hundreds_ft", "thousands_ft"]},
    "needles": ALTIMETER["needles"][1:],
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("root_half", "level", "hidden_ft", "climbs"),
    [(7.0, 110.0, 6_667.0, True), (7.0, 215.0, 6_667.0, False), (12.0, 110.0, 6_660.0, False)],
    ids=["dim, down and up", "bright, anywhere", "broad, anywhere"],
)
def test_coarsest_pointer_that_the_panel_picture_hides_is_learned_though_it_moves_far(
    root_half: float, level: float, hidden_ft: float, *, climbs: bool
) -> None:
    """At 6,667 ft both lie on each other; the long one tells hundreds of feet, and ten places where the other may be.

    It is not at the one nearest to where it is drawn, as a slow one would be, but where all frames show the same. A
    dim one is not read without that, nor is the long one where a bright one explains more of the dial.
    """
    forms, rng = (Hand(tip=34.0, root_half=root_half, tip_half=0.5, level=level), FORMS[2]), np.random.default_rng(23)
    altitudes_ft = rng.permutation(6_180.0 + 3_600.0 * np.abs(np.linspace(-1.0, 1.0, 40)))
    if not climbs:
        altitudes_ft = rng.uniform(0.0, 9_999.0, 40)

    def picture(altitude_ft: float, seed: int) -> GreyPicture:
        return drawn(angles_of(altitude_ft)[1:], forms, seed)

    needles = [
        {**needle, "template": {**needle["template"], "at": 270.0 + (angle_deg - 270.0) % 360.0}}
        for needle, angle_deg in zip(TWO_POINTERS["needles"], angles_of(hidden_ft)[1:], strict=True)
    ]
    frames = [picture(altitude_ft, seed) for seed, altitude_ft in enumerate(altitudes_ft[:16], start=1)]
    drawn_on = reader_for([TWO_POINTERS | {"needles": needles}], picture(hidden_ft, 0))
    reader = fit_to_flight(drawn_on, lambda _: frames).reader
    off_ft = []
    for seed, altitude_ft in enumerate(altitudes_ft[16:].tolist(), start=50):
        reading = read_picture(reader, picture(altitude_ft, seed)).readings["altitude_ft"]
        if reading.status is not Status.MISSING:
            off_ft.append(apart(reading.angle_deg / 360.0 * 10_000.0, altitude_ft, 10_000.0))

    assert len(off_ft) >= 0.8 * len(altitudes_ft[16:])
    assert max(off_ft) < 10.0


CLOCK: dict[str, Any] = {
    "name": "clock",
    "radius": [12, 66],
    "sweep": [270, 630],
    "unit": "s",
    "scale": [[270.0, 0.0], [450.0, 1800.0]],
    "wraps": 3600,
    "combined": {"name": "clock_s", "needles": ["hour_s", "minute_s", "second_s"]},
    "needles": [
        {"name": "hour_s", "template": {"at": 20.0, "span": 30}, "covered_by": "minute_s"}
        | {"scale": [[270.0, 0.0], [450.0, 21_600.0]], "wraps": 43_200},
        {"name": "minute_s", "template": {"at": 140.0, "span": 24}, "covered_by": "second_s"},
        {
            "name": "second_s",
            "template": {"at": 250.0, "span": 14},
            "scale": [[270.0, 0.0], [450.0, 30.0]],
            "wraps": 60,
        },
    ],
}
CLOCK_FORMS = (
    Hand(tip=38.0, root_half=3.0, tip_half=2.0, level=230.0),
    Hand(tip=58.0, root_half=2.4, tip_half=1.4, level=230.0),
    Hand(tip=64.0, root_half=1.2, tip_half=1.0, level=230.0),
)


def clock(time_s: float, seed: int = 0) -> GreyPicture:
    """A clock at a time of day."""
    angles_deg = [270.0 + 360.0 * (time_s % turn_s) / turn_s for turn_s in (43_200.0, 3600.0, 60.0)]
    return drawn(angles_deg, CLOCK_FORMS, seed)


@pytest.mark.slow
def test_clock_is_read_to_the_second() -> None:
    """A clock's three hands are 720 turns of the finest: each is told, or none."""
    times_s = np.random.default_rng(3).uniform(0.0, 43_200.0, 60)
    reader = reader_for(
        [CLOCK],
        drawn((20.0, 140.0, 250.0), CLOCK_FORMS, 1),
        [clock(time_s, seed) for seed, time_s in enumerate(times_s[:24])],
    )
    off_s = []
    for seed, time_s in enumerate(times_s[24:].tolist()):
        reading = read_picture(reader, clock(time_s, 50 + seed)).readings["clock_s"]
        if reading.status is not Status.MISSING:
            told_s = reading.angle_deg / 360.0 * 43_200.0
            off_s.append(apart(told_s, time_s, 43_200.0))

    assert len(off_s) >= 0.9 * len(times_s[24:])
    assert max(off_s) < 1.0


def clock_with_rim_hand(angles_deg: Sequence[float], seed: int = 0) -> GreyPicture:
    """A clock whose seconds hand shows only near the rim, as if the rest of it were black."""

    def what(canvas: Canvas) -> None:
        canvas.dial(range(0, 360, 30))
        for form, angle_deg in zip(CLOCK_FORMS[:2], angles_deg, strict=False):
            canvas.hand(form, angle_deg)
        canvas.bar(angles_deg[2], (50.0, 66.0), (1.4, 1.4), 150.0)
        canvas.disc(CENTRE, 16.0, 200.0)

    return paint(what, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("second_deg", [250.0, 25.0], ids=["over the hub", "beside the hour hand"])
def test_hand_that_shows_only_near_the_rim_is_not_the_one_below_it(second_deg: float) -> None:
    """What lies on its axis nearer to the centre is the hub, or another hand, and moves otherwise."""
    *others, second = CLOCK["needles"]
    panel = {**CLOCK, "needles": [*others, {**second, "template": {"at": second_deg, "span": 14}}]}
    times_s = [30_300.0 + 3.7 * frame for frame in range(40)]
    pictures = [
        clock_with_rim_hand([270.0 + 360.0 * (time_s % turn) / turn for turn in (43_200.0, 3600.0, 60.0)], seed)
        for seed, time_s in enumerate(times_s)
    ]
    reader = reader_for([panel], clock_with_rim_hand((20.0, 140.0, second_deg), 90), pictures[::2])
    found = [read_picture(reader, picture).readings["second_s"] for picture in pictures]
    seen = [(each, time_s) for each, time_s in zip(found, times_s, strict=True) if each.is_seen]

    assert len(seen) >= 36
    assert all(apart(each.angle_deg, 270.0 + 6.0 * time_s) < 1.0 for each, time_s in seen)
