"""Displays of seven segments: they are read with certainty, or not at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from decoder.imaging.unwrapping import WindowGrid
from decoder.instruments.kinds.windows.digits import DigitsReader
from decoder.instruments.kinds.windows.display import Display, Row, in_picture
from decoder.instruments.reading import Reading, Status
from decoder.panel.arrays import Floats
from decoder.panel.kinds.digits import Digits
from tests.decoder.instruments.displays import Drawn, exposed, sampled

SHOWS = "118.30"
DIGITS = Digits(name="nav1_mhz", pattern="000.00", shows=SHOWS)
PLAIN = Drawn()
VALUES = ["118.30", "109.45", "112.67", "117.95", "108.10", "116.82", "113.53", "115.74", "110.26", "114.98"]


def known(digits: Digits, grid: WindowGrid, picture: Floats) -> Display | None:
    """The display as a panel picture shows it."""
    row = Row(digits.symbols, np.array(digits.before, float), digits.points, np.array(digits.may_be_blank))
    return in_picture(sampled(grid, picture), row, grid.margin)


def read(digits: Digits, display: Display | None, strips: Sequence[Floats]) -> list[Reading]:
    """The display in frames."""
    return [found[digits.name] for found in DigitsReader(digits, display).read(np.stack(strips), np.zeros(len(strips)))]


def told(reading: Reading) -> str | None:
    """What was read, as a radio writes it."""
    return f"{reading.angle_deg:.2f}" if reading.status is Status.READ else None


@pytest.fixture(scope="module")
def taught() -> tuple[WindowGrid, Display]:
    """A display that was drawn around with care, and a flight in dimmer light."""
    grid = PLAIN.grid()
    display = known(DIGITS, grid, exposed(PLAIN.picture(SHOWS)))
    assert display is not None
    frames = [sampled(grid, exposed(PLAIN.picture(text), light=0.7, seed=7)) for text in VALUES[:6]]
    return grid, display.taught(np.stack(frames))


@pytest.mark.parametrize("light", [0.45, 1.6])
def test_all_digits_are_read_though_the_panel_picture_shows_a_few(
    taught: tuple[WindowGrid, Display], light: float
) -> None:
    """The places of the segments determine every digit's look, in any light on the panel."""
    grid, display = taught
    frames = [
        sampled(grid, exposed(PLAIN.picture(text), light=light, ground=10.0 + 40.0 * light, seed=number))
        for number, text in enumerate(VALUES)
    ]

    found = read(DIGITS, display, frames)

    assert [told(one) for one in found] == VALUES
    assert all(0.0028 < one.sigma_deg < 0.0029 for one in found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drawn", "seed"), [(PLAIN, 0), (Drawn(slant=0.0, stroke=2.4, height=17.0, width=9.0, pitch=14.0), 1)]
)
def test_dark_digits_on_light_ground_drawn_around_by_hand(drawn: Drawn, seed: int) -> None:
    """An error of a pixel and a half in drawing loses nothing, and a liquid crystal is read like a lit display."""
    grid = drawn.grid(np.random.default_rng(seed).uniform(-1.5, 1.5, 8).tolist())
    frames = [
        sampled(grid, exposed(drawn.picture(text), light=-0.8, ground=140.0, seed=number))
        for number, text in enumerate(VALUES)
    ]
    display = known(DIGITS, grid, exposed(drawn.picture(SHOWS), light=-0.8, ground=140.0))
    assert display is not None

    assert [told(one) for one in read(DIGITS, display.taught(np.stack(frames)), frames)] == VALUES


def test_a_dark_display_and_one_between_two_values_have_none(taught: tuple[WindowGrid, Display]) -> None:
    """Neither the faint glow of dark segments nor half of two values is a value."""
    grid, display = taught
    half = 0.5 * PLAIN.picture("118.30") + 0.5 * PLAIN.picture("118.35")
    changing = 0.5 * PLAIN.picture("118.38") + 0.5 * PLAIN.picture("118.30")
    dark, ghost = 0.0 * half, 0.05 * PLAIN.picture("888.88")

    found = read(DIGITS, display, [sampled(grid, exposed(one)) for one in (half, changing, dark, ghost)])

    assert [told(one) for one in found] == [None] * 4


@pytest.mark.slow
@pytest.mark.parametrize(("dead", "least"), [((4, "e"), 4), ((3, "g"), 0), ((2, "b"), 0)])
def test_a_dead_segment_makes_no_other_digit(dead: tuple[int, str], least: int) -> None:
    """A dead segment may turn one digit into another: no such digit is read.

    In a cell whose digit in the panel picture is mistaken, hardly any digit is read.
    """
    drawn = Drawn(dead=(dead,))
    grid = drawn.grid()
    texts = [*VALUES, "118.38", "118.88", "118.08", "112.36", "119.39", "111.17"]
    frames = [sampled(grid, exposed(drawn.picture(text), seed=number)) for number, text in enumerate(texts)]
    display = known(DIGITS, grid, exposed(drawn.picture(SHOWS)))
    assert display is not None

    found = [told(one) for one in read(DIGITS, display.taught(np.stack(frames)), frames)]

    assert {one for one in zip(found, texts, strict=True) if one[0] not in (None, one[1])} == set()
    assert sum(one is not None for one in found) >= least


def test_a_display_that_moves_its_point_is_not_read(taught: tuple[WindowGrid, Display]) -> None:
    """Without the point that is described, or with another one, the digits mean something else."""
    grid, display = taught
    whole = Digits(name="dme_nm", pattern="000", shows="128")
    drawn = Drawn(pattern="000")
    plain = known(whole, drawn.grid(), exposed(drawn.picture("128")))
    tenths = [Drawn(pattern="000", points=points).picture("128") for points in ((), (0,), (1,))]

    without = read(DIGITS, display, [sampled(grid, exposed(PLAIN.picture(text))) for text in ("118.30", "118 30")])
    found = read(whole, plain, [sampled(drawn.grid(), exposed(one)) for one in tenths])

    assert [told(one) for one in without] == ["118.30", None]
    assert [one.status for one in found] == [Status.READ, Status.MISSING, Status.MISSING]


def test_a_speck_of_dirt_where_a_point_may_be_is_no_dark_point() -> None:
    """A display that is clean in the flight shows no other point than its panel picture."""
    grid, text = PLAIN.grid(), PLAIN.picture(SHOWS)
    speck = Drawn(points=(0,)).picture(SHOWS) - text
    display = known(DIGITS, grid, exposed(text - 0.5 * speck, ground=60.0))

    found = read(DIGITS, display, [sampled(grid, exposed(PLAIN.picture(each), ground=60.0)) for each in VALUES])

    assert [told(one) for one in found] == VALUES


@pytest.mark.parametrize(("digit", "form"), [("7", "abcf"), ("6", "cdefg"), ("9", "abcfg")])
def test_the_flight_tells_how_a_digit_is_drawn_that_the_panel_picture_does_not_show(digit: str, form: str) -> None:
    """A display that draws a digit in another way than most is read like any other."""
    drawn = Drawn(forms=((digit, form),))
    grid = drawn.grid()
    texts = [f"11{own}.{digit}{digit}" for own in "012345"] + VALUES
    frames = [sampled(grid, exposed(drawn.picture(text), seed=number)) for number, text in enumerate(texts)]
    display = known(DIGITS, grid, exposed(drawn.picture(SHOWS)))
    assert display is not None

    found = read(DIGITS, display.taught(np.stack(frames[:6])), frames)

    assert [told(one) for one in found] == texts


def test_one_frame_in_mid_change_breaks_no_segment() -> None:
    """Segments that fade are dark for a moment; a broken one stays dark."""
    grid = PLAIN.grid()
    one, next_one = PLAIN.picture("118.34"), PLAIN.picture("118.36")
    fading = exposed(np.minimum(one, next_one) + 0.3 * np.abs(one - next_one))
    frames = [sampled(grid, exposed(PLAIN.picture(text), seed=number)) for number, text in enumerate(VALUES)]
    display = known(DIGITS, grid, exposed(PLAIN.picture(SHOWS)))
    assert display is not None

    own = display.taught(np.stack([*frames, sampled(grid, fading), *frames]))

    assert [told(one) for one in read(DIGITS, own, frames)] == VALUES


def test_digits_with_a_dead_segment_teach_nothing() -> None:
    """A flight that shows mostly eights without a segment makes no nines of threes, nor threes of nines."""
    drawn = Drawn(dead=((4, "f"),))
    grid, glow = drawn.grid(), 0.08 * PLAIN.picture("888.88")
    texts = ["118.38", "109.48", "112.68", "117.98", "108.18", "118.33", "116.83", "113.53", "118.39", "116.81"]
    shown = [np.maximum(drawn.picture(text), glow) for text in texts]
    frames = [sampled(grid, exposed(one, seed=number)) for number, one in enumerate(shown)]
    display = known(DIGITS, grid, exposed(np.maximum(drawn.picture(SHOWS), glow)))
    assert display is not None

    found = [told(one) for one in read(DIGITS, display.taught(np.stack(frames[:8])), frames)]

    assert {one for one in zip(found, texts, strict=True) if one[0] not in (None, one[1])} == set()
    assert found[-1] == texts[-1]


def test_a_reflection_across_it_is_read_through_or_nothing_is(taught: tuple[WindowGrid, Display]) -> None:
    """Light may vary along the window; hidden digits are missing."""
    grid, display = taught
    shown = PLAIN.picture("116.82")
    across = np.arange(shown.shape[1]) - np.linspace(0.0, shown.shape[1], 12)[:, None]
    soft = [exposed(shown) + 60.0 * np.exp(-((own / 15.0) ** 2))[None] for own in across]
    hard = [np.where(np.abs(own) < 6.0, 250.0, exposed(shown)) for own in across]
    strips = [sampled(grid, np.clip(one, 0.0, 255.0).astype(np.float32)) for one in [*soft, *hard]]

    found = [told(one) for one in read(DIGITS, display, strips)]

    assert set(found) <= {"116.82", None}
    assert found[: len(soft)].count("116.82") >= len(soft) - 2


def test_other_frames_change_nothing(taught: tuple[WindowGrid, Display]) -> None:
    """What is read of a frame is the same to the last bit, whatever is read along with it."""
    grid, display = taught
    frames = [sampled(grid, exposed(PLAIN.picture(text), seed=3)) for text in VALUES]

    assert read(DIGITS, display, frames) == [one for frame in frames for one in read(DIGITS, display, [frame])]


def test_zeros_in_front_may_be_dark_and_a_code_keeps_them() -> None:
    """A pattern says where there may be no digit, and text is written by it."""
    speed = Digits(name="dme_kt", pattern="##0", shows=" 74")
    drawn = Drawn(pattern="##0")
    display = known(speed, drawn.grid(), exposed(drawn.picture(" 74")))
    frames = [sampled(drawn.grid(), exposed(drawn.picture(text))) for text in ("  9", " 15", "108", "1 8")]

    found = [one.angle_deg if one.status is Status.READ else None for one in read(speed, display, frames)]

    assert found == [9.0, 15.0, 108.0, None]
    assert Digits(name="code", pattern="0000", shows="7000", text=True).written.text_of(421.0) == "0421"


@pytest.mark.parametrize("shows", [SHOWS, "545.72"])
def test_a_picture_that_shows_something_else_teaches_nothing_wrong(shows: str) -> None:
    """Wherever the window is drawn, and whatever is there: the display is read, or missing."""
    picture = exposed(PLAIN.picture(shows))
    for off_px in (np.zeros(8), np.random.default_rng(2).uniform(-6.0, 6.0, 8)):
        grid = PLAIN.grid(off_px.tolist())
        found = read(DIGITS, known(DIGITS, grid, picture), [sampled(grid, exposed(PLAIN.picture("116.82")))])

        assert {told(one) for one in found} <= {None, "116.82"}


@pytest.mark.parametrize("part", [0.3, 0.4, 0.5])
def test_two_values_in_one_exposure_make_no_third(taught: tuple[WindowGrid, Display], part: float) -> None:
    """A value that changes while the shutter is open is read as the old one, as the new one, or not at all.

    3 over 4 is a 9, and 5 over 2 an 8; 1 over 8 beside 6 over 5 is an 8 beside a 6.
    """
    grid, display = taught
    pairs = [
        ("116.15", "115.85"),
        ("118.80", "113.33"),
        ("112.45", "115.72"),
        ("113.51", "114.26"),
        ("108.10", "103.18"),
    ]
    both = [[PLAIN.picture(own) for own in pair] for pair in pairs]
    light = [part * one + (1 - part) * other for one, other in both]
    frames = [sampled(grid, exposed(levels ** (1 / 2.2), seed=number)) for number, levels in enumerate(light)]

    found = read(DIGITS, display, frames)

    assert all(told(one) in (None, *pair) for one, pair in zip(found, pairs, strict=True))


def test_a_leading_digit_that_is_lit_for_half_of_the_exposure_is_no_digit() -> None:
    """Where 12 becomes 8 while the shutter is open, 18 is neither."""
    drawn, digits = Drawn(pattern="##0"), Digits(name="oat_degc", pattern="##0", shows=" 12")
    grid = drawn.grid()
    display = known(digits, grid, exposed(drawn.picture(" 12")))
    assert display is not None
    before, after = drawn.picture(" 10"), drawn.picture("  8")
    frames = [
        sampled(grid, exposed((part * before + (1 - part) * after) ** (1 / 2.2))) for part in (0.25, 0.3, 0.4, 0.5)
    ]

    found = read(digits, display, frames)

    assert all(one.status is Status.MISSING or one.angle_deg in (10.0, 8.0) for one in found)


def test_digits_lit_one_after_the_other_are_not_taken_for_blanks() -> None:
    """If a short exposure misses digits, one in front that is dark in a frame may be one that was missed."""
    drawn, digits = Drawn(pattern="##0"), Digits(name="distance_nm", pattern="##0", shows="142")
    grid = drawn.grid()
    display = known(digits, grid, exposed(drawn.picture("142")))
    assert display is not None
    texts = ["142", "1 5", "136", " 35", "151", "149"]
    frames = np.stack([sampled(grid, exposed(drawn.picture(text), seed=number)) for number, text in enumerate(texts)])

    found = read(digits, display.taught(frames), list(frames))

    assert [int(one.angle_deg) if one.status is Status.READ else None for one in found] == [
        142,
        None,
        136,
        None,
        151,
        149,
    ]
    whole = read(digits, display.taught(frames[[0, 2, 2, 4, 5]]), list(frames[3:4]))
    assert [one.angle_deg for one in whole if one.status is Status.READ] == [35.0]


def test_the_shadow_of_an_unlit_digit_teaches_no_dim_segments() -> None:
    """A liquid crystal seen from the side shows an 8 in a dark cell: its segments are no digit's, and are not dim."""
    drawn, digits = Drawn(pattern="##0"), Digits(name="flow_gph", pattern="##0", shows="117")
    grid = drawn.grid()
    display = known(digits, grid, exposed(drawn.picture("117"), light=-1.0, ground=140.0))
    assert display is not None
    shadow = 0.55 * drawn.picture("8  ")
    frames = [
        sampled(grid, exposed(np.maximum(drawn.picture(text), shadow), light=-1.0, ground=140.0, seed=number))
        for number, text in enumerate([" 17", " 14", " 35", " 43", " 57", " 91"])
    ]
    texts = ["206", "168", "860", "602"]
    clear = [sampled(grid, exposed(drawn.picture(text), light=-1.0, ground=140.0, seed=9)) for text in texts]

    found = read(digits, display.taught(np.stack(frames)), [*clear, frames[0]])

    assert [int(one.angle_deg) if one.status is Status.READ else None for one in found] == [*map(int, texts), None]
