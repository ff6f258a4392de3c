"""Pointers on straight scales are read where they are, in any light; if in doubt, nothing is read."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from decoder.instruments.kinds.windows.linear import LinearPicture, Slide, SlideReader, first_linear, learn_linear
from decoder.instruments.reading import Reading, Status
from decoder.panel.arrays import Floats
from tests.decoder.instruments.straight import bar, gauge_of, seen

# A scale that leans; its marks are given by points.
CORNERS = [[40.0, 20.0], [62.0, 22.0], [52.0, 142.0], [30.0, 140.0]]
MARKS = [[[50.1, 30.0], 0], [[45.95, 80.0], 10], [[42.6, 120.0], 30]]
GAUGE, GRID = gauge_of(
    CORNERS, linear={"name": "flap_deg", "moves": "down", "at": [50.1, 30.0], "span": 24, "marks": MARKS}
)
SLIDE = Slide.of(GAUGE, GRID)


def window(
    at_y: float,
    seed: int = 0,
    *,
    gain: float = 1.0,
    slope: float = 0.0,
    doubled: float | None = None,
    readout: float = 0.0,
) -> Floats:
    """A slot, half dark and half a bright card with print; a grey pointer stands at a height, maybe another too.

    Below the scale's end, a readout may be as bright as this.
    """

    def levels(x: Floats, y: Floats) -> Floats:
        right = x > 46.0 - (y - 80.0) / 12.0
        card = np.where(y < 70.0, 150.0, 210.0) - 60.0 * (np.sin(y / 3.0) > 0.9)
        scale = np.where(right, card, 20.0)
        for middle in (at_y, at_y if doubled is None else doubled):
            covered = bar(y - middle, 4.0)
            scale = covered * 110.0 + (1.0 - covered) * scale
        return np.where((y > 130.0) & (readout > 0.0), readout * (np.sin(y) > 0.0), scale)

    return seen(GRID, levels, seed, gain=gain, slope=slope)


def value(at_y: float) -> float:
    """What a pointer at a height shows."""
    return float(np.interp(at_y, [30.0, 80.0, 120.0], [0.0, 10.0, 30.0]))


def learned(*heights: float) -> LinearPicture:
    """A scale drawn with its pointer at the top, taught by frames in which it stands at these heights."""
    strips = [window(at_y, seed + 1, gain=0.6 + 0.05 * seed) for seed, at_y in enumerate(heights)]
    return learn_linear(SLIDE, strips, first_linear(SLIDE, window(30.0)))


def read(picture: LinearPicture, *strips: Floats) -> list[Reading]:
    """The pointer in frames."""
    return [found["flap_deg"] for found in SlideReader(SLIDE, picture).read(np.stack(strips), np.zeros(len(strips)))]


# It stands at the top in nearly all frames, as flaps do.
TAUGHT = learned(*[30.0] * 8, 80.0, 80.0, 101.0, 120.0)


@pytest.mark.parametrize("at_y", [30.0, 64.0, 101.6])
@pytest.mark.parametrize("light", [(1.0, 0.0), (0.5, 0.5)])
def test_it_is_read_where_it_stands(at_y: float, light: tuple[float, float]) -> None:
    """Over dark and bright parts of its scale alike, to a quarter of a pixel, also where no frame taught it."""
    (found,) = read(TAUGHT, window(at_y, 99, gain=light[0], slope=light[1]))
    (quantity,) = GAUGE.quantities
    at_px, values = np.array(quantity.marks).T

    assert found.status is Status.READ
    assert found.angle_deg == pytest.approx(np.interp(value(at_y), values, at_px), abs=0.25)


@pytest.mark.parametrize("missed_px", [0.0, 1.5, 4.0])
def test_a_pointer_drawn_beside_its_middle_is_doubted_by_as_much(missed_px: float) -> None:
    """All readings are off by what the hand missed it by: a 95 % interval covers that, and is narrow without it."""
    heights = [30.0] * 8 + [80.0, 80.0, 101.0, 120.0]
    strips = [window(at_y + missed_px, seed + 1) for seed, at_y in enumerate(heights)]
    picture = learn_linear(SLIDE, strips, first_linear(SLIDE, window(30.0 + missed_px)))
    (there,) = read(TAUGHT, window(64.0, 99))
    (found,) = read(picture, window(64.0, 99))

    assert found.angle_deg == pytest.approx(there.angle_deg - missed_px, abs=0.3)
    assert found.sigma_deg == pytest.approx(math.hypot(0.7 * missed_px, 0.5), abs=0.35)


def test_two_pointers_are_none() -> None:
    """If two places look like the pointer, or none does, nothing is read."""
    (double,) = read(TAUGHT, window(50.0, 5, doubled=100.0))
    (none,) = read(TAUGHT, window(-40.0, 6))

    assert {double.status, none.status} == {Status.MISSING}


def test_it_is_read_whatever_a_readout_beyond_its_scale_shows() -> None:
    """Digits that change below the last mark lie where no pointer can be: they cast no doubt on it."""
    heights = [30.0] * 8 + [80.0, 80.0, 101.0, 120.0]
    strips = [window(at_y, seed + 1, readout=60.0 + 15.0 * seed) for seed, at_y in enumerate(heights)]
    picture = learn_linear(SLIDE, strips, first_linear(SLIDE, window(30.0, readout=240.0)))
    found = read(picture, *(window(64.0, 99, readout=shown) for shown in (240.0, 90.0, 1.0)))

    assert [one.status for one in found] == [Status.READ] * 3


def among_dots(at_y: float, seed: int, level: float, blur: float) -> Floats:
    """A dark slot with a row of uneven bright dots, before which a wedge stands at a height."""

    def levels(x: Floats, y: Floats) -> Floats:
        left = 46.0 - (y - 80.0) / 12.0
        is_dot = (np.abs((y - 24.0) % 10.0 - 5.0) < 2.0) & (np.abs(x - left) < 5.0)
        is_dot &= np.sin(7.0 * np.floor((y - 24.0) / 10.0) + 1.9 * x) > -0.4
        wedge = np.clip(np.clip((x - left + 7.0) / 1.6, 0.0, 7.0) - np.abs(y - at_y) + 0.5, 0.0, 1.0) * (x < left + 5.0)
        return wedge * level + (1.0 - wedge) * np.where(is_dot, 170.0, 15.0)

    strip = seen(GRID, levels, seed)
    return np.asarray(cv2.GaussianBlur(strip, (0, 0), blur), np.float32) if blur else strip


@pytest.mark.parametrize(("level", "drawn_blur", "blur"), [(90.0, 0.8, 1.2), (170.0, 0.0, 0.8)])
def test_a_pointer_among_print_is_learned_from_frames_less_sharp_than_its_picture(
    level: float, drawn_blur: float, blur: float
) -> None:
    """There what covers a sharp dot differs from what the blurred scale shows: nothing had been learned at all."""
    taught = np.linspace(36.0, 118.0, 16)
    strips = [among_dots(at_y, seed, level, blur) for seed, at_y in enumerate(taught, start=1)]
    picture = learn_linear(SLIDE, strips, first_linear(SLIDE, among_dots(30.0, 0, level, drawn_blur)))
    asked = np.linspace(40.0, 114.0, 25)
    found = read(picture, *(among_dots(at_y, seed, level, blur) for seed, at_y in enumerate(asked, start=50)))
    (quantity,) = GAUGE.quantities
    at_px, values = np.array(quantity.marks).T

    assert [one.status for one in found] == [Status.READ] * len(asked)
    assert [one.angle_deg for one in found] == pytest.approx(
        [float(np.interp(value(at_y), values, at_px)) for at_y in asked], abs=0.5
    )


def test_frames_beside_it_change_nothing() -> None:
    """A frame is read the same to the bit, whatever frames are read with it."""
    frames = [window(at_y, 7) for at_y in (30.0, 55.0, 90.0)]

    assert [read(TAUGHT, frame)[0] for frame in frames] == read(TAUGHT, *frames)


def test_its_value_is_drawn_across_its_window() -> None:
    """The line that is drawn of a value crosses the window at its mark."""
    ((one, other),) = GAUGE.lines({"flap_deg": 10.0}).values()
    ends = [
        (GAUGE.centre[0] + px * np.cos(np.radians(deg)), GAUGE.centre[1] + px * np.sin(np.radians(deg)))
        for deg, px in (one, other)
    ]

    assert np.mean(ends, axis=0) == pytest.approx([45.95, 80.0], abs=0.5)


def assert_read(draw: Callable[[float, int], Floats], cut: tuple[float, float], heights: Floats, asked: Floats) -> None:
    """A pointer that is cut at a height, and as many pixels high, is read where asked once a flight has taught it."""
    at, span = cut
    gauge, grid = gauge_of(
        CORNERS, linear={"name": "flap_deg", "moves": "down", "at": at, "span": span, "marks": MARKS}
    )
    slide = Slide.of(gauge, grid)
    strips = [draw(at_y, seed + 1) for seed, at_y in enumerate(heights.tolist())]
    reader = SlideReader(slide, learn_linear(slide, strips, first_linear(slide, draw(at, 0))))
    found = reader.read(np.stack([draw(at_y, 50) for at_y in asked.tolist()]), np.zeros(len(asked)))
    (quantity,) = gauge.quantities
    at_px, values = np.array(quantity.marks).T
    true_px = np.interp([value(at_y) for at_y in asked.tolist()], values, at_px)
    off_px = [one["flap_deg"].angle_deg - px for one, px in zip(found, true_px.tolist(), strict=True)]

    assert [one["flap_deg"].status for one in found] == [Status.READ] * len(asked)
    assert np.abs(off_px).max() < 1.0


def filled(at_y: float, seed: int = 0, *, arm: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """A printed card on which a bar rises from below to a height; an arm may lie over it, from a height so far down."""

    def levels(x: Floats, y: Floats) -> Floats:
        card = 200.0 - 90.0 * (np.sin(y / 3.0) > 0.9) * (x < 40.0)
        part = 1.0 / (1.0 + np.exp((at_y - y) / 0.5))
        scale = part * 60.0 + (1.0 - part) * card
        covered = bar(y - arm[0] - arm[1] / 2, arm[1] / 2, 0.8) if arm[1] else np.zeros_like(y)
        return covered * 120.0 + (1.0 - covered) * scale

    return seen(GRID, levels, seed)


def from_its_middle(at_y: float, seed: int = 0) -> Floats:
    """A slot in which a bar grows from its middle, up or down to a height."""

    def levels(_: Floats, y: Floats) -> Floats:
        part = bar(y - (at_y + 75.0) / 2, abs(at_y - 75.0) / 2)
        return part * 150.0 + (1.0 - part) * 60.0

    return seen(GRID, levels, seed)


@pytest.mark.parametrize("drawn_y", [40.0, 110.0])
def test_a_bar_that_grows_either_way_is_read_on_both_sides(drawn_y: float) -> None:
    """Its beginning, which looks on one side as its end does on the other, had been read as its end."""
    asked = np.array([34.0, 50.0, 60.0, 86.0, 92.0, 100.0, 115.0])
    assert_read(from_its_middle, (drawn_y, 16.0), np.linspace(36.0, 118.0, 16), asked)


@pytest.mark.parametrize("drawn_y", [50.0, 80.0, 110.0])
def test_the_end_of_a_bar_is_read_above_and_below_where_it_is_drawn(drawn_y: float) -> None:
    """What a bar covers is learned as the card's, wherever the bar has been shorter."""
    assert_read(filled, (drawn_y, 24.0), np.linspace(36.0, 118.0, 16), np.linspace(38.0, 116.0, 27))


def graded(at_y: float, seed: int = 0) -> Floats:
    """A bar that rises from below in a slot which is ever brighter further down, nearly as bright as the bar there."""

    def levels(_: Floats, y: Floats) -> Floats:
        part = 1.0 / (1.0 + np.exp((at_y - y) / 0.5))
        return part * 122.0 + (1.0 - part) * (40.0 + 0.6 * (y - 20.0))

    return seen(GRID, levels, seed)


@pytest.mark.parametrize("drawn_y", [60.0, 85.0, 110.0])
def test_the_end_of_a_bar_over_an_uneven_scale_is_as_sure_as_over_an_even_one(drawn_y: float) -> None:
    """Also if the bar fills most of its scale where it is drawn; the part that it always covers is not known."""
    heights = np.linspace(32.0, 112.0, 16)
    gauge, grid = gauge_of(
        CORNERS, linear={"name": "flap_deg", "moves": "down", "at": drawn_y, "span": 20.0, "marks": MARKS}
    )
    slide = Slide.of(gauge, grid)
    strips = [graded(at_y, seed + 1) for seed, at_y in enumerate(heights.tolist())]
    picture = learn_linear(slide, strips, first_linear(slide, graded(drawn_y)))
    found = read(picture, *(graded(at_y, 50) for at_y in (36.0, 60.0, 84.0)))

    assert {one.status for one in found} == {Status.READ}
    assert max(one.sigma_deg for one in found) < 1.0


@pytest.mark.parametrize("missed_px", [0.0, 3.0])
def test_a_bar_drawn_beside_its_end_is_doubted_by_as_much(missed_px: float) -> None:
    """The flight shows where the bar ends, and so what the hand missed it by."""
    heights = np.linspace(36.0, 118.0, 16) + missed_px
    gauge, grid = gauge_of(
        CORNERS, linear={"name": "flap_deg", "moves": "down", "at": 80.0, "span": 24, "marks": MARKS}
    )
    slide = Slide.of(gauge, grid)
    strips = [filled(at_y, seed + 1) for seed, at_y in enumerate(heights.tolist())]
    picture = learn_linear(slide, strips, first_linear(slide, filled(80.0 + missed_px)))
    (found,) = read(picture, filled(64.0, 99))

    assert found.sigma_deg == pytest.approx(math.hypot(0.7 * missed_px, 0.5), abs=0.25)


@pytest.mark.parametrize(("top", "high"), [(25.0, 30.0), (25.0, 60.0), (25.0, 90.0), (40.0, 30.0), (40.0, 60.0)])
def test_the_edge_of_what_lies_over_a_bar_is_not_its_end(top: float, high: float) -> None:
    """An arm over its scale, darker than the card and brighter than the bar, ends as a bar does."""
    gauge, grid = gauge_of(
        CORNERS, linear={"name": "flap_deg", "moves": "down", "at": 80.0, "span": 24.0, "marks": MARKS}
    )
    slide = Slide.of(gauge, grid)
    taught = [filled(at_y, seed + 1) for seed, at_y in enumerate(np.linspace(36.0, 118.0, 16).tolist())]
    reader = SlideReader(slide, learn_linear(slide, taught, first_linear(slide, filled(80.0))))
    (quantity,) = gauge.quantities
    at_px, values = np.array(quantity.marks).T
    for at_y in (50.0, 80.0, 100.0):
        (found,) = reader.read(filled(at_y, 50, arm=(top, high))[None], np.zeros(1))
        off_px = found["flap_deg"].angle_deg - np.interp(value(at_y), values, at_px)

        assert found["flap_deg"].status is Status.MISSING or abs(off_px) < 1.0


def column(at_y: float, seed: int = 0) -> Floats:
    """A thermometer's column in glass that is brighter at its edge and further down, and as bright as it at y = 60."""

    def levels(x: Floats, y: Floats) -> Floats:
        middle = 46.0 - (y - 80.0) / 12.0
        glass = 102.0 + 0.5 * (y - 60.0) + 45.0 * (np.abs(x - middle) > 8.0)
        part = 1.0 / (1.0 + np.exp((at_y - y) / 0.5))
        return part * 102.0 + (1.0 - part) * glass

    return seen(GRID, levels, seed)


def test_a_bar_as_bright_as_its_scale_is_read_after_it_stood_still_for_long() -> None:
    """A column that hardly shows where it is drawn, and stays there for half the flight, is read where it falls to."""
    heights = np.concatenate([np.full(8, 60.0), np.linspace(66.0, 116.0, 8)])
    assert_read(column, (60.0, 16.0), heights, np.linspace(60.0, 114.0, 19))


def mercury(
    at_y: float, seed: int = 0, *, tip_from: float = 0.0, levels: tuple[float, float] = (50.0, 235.0)
) -> Floats:
    """A bar that rises from below to a height, in a slot with a frame; it is white above another height, if any."""

    def drawn(_: Floats, y: Floats) -> Floats:
        own = np.where(y < tip_from, 250.0, levels[0])
        part = 1.0 / (1.0 + np.exp((at_y - y) / 1.2))
        return np.where((y < 26.0) | (y > 136.0), 90.0, part * own + (1.0 - part) * levels[1])

    return seen(GRID, drawn, seed)


def test_a_bar_is_read_where_one_frame_alone_showed_it() -> None:
    """There it covered most of its window, and had been taken for a scale in other light."""
    heights = np.array([*np.linspace(92.0, 118.0, 15), 36.0])
    assert_read(mercury, (105.0, 16.0), heights, np.linspace(36.0, 116.0, 21))


def mercury_of(levels: tuple[float, float], drawn_y: float = 90.0) -> SlideReader:
    """A reader of such a bar, taught by a flight."""
    gauge, grid = gauge_of(
        CORNERS, linear={"name": "flap_deg", "moves": "down", "at": drawn_y, "span": 16.0, "marks": MARKS}
    )
    slide = Slide.of(gauge, grid)
    strips = [mercury(at_y, seed + 1, levels=levels) for seed, at_y in enumerate(np.linspace(60.0, 118.0, 16).tolist())]
    return SlideReader(slide, learn_linear(slide, strips, first_linear(slide, mercury(drawn_y, levels=levels))))


@pytest.mark.parametrize("over_px", [12.0, 18.0, 24.0])
def test_where_a_bar_changes_its_colour_is_not_its_end(over_px: float) -> None:
    """Above a level it is brighter than its scale: the step there is stronger than the light on the rest makes it."""
    levels = (20.0, 120.0)
    (found,) = mercury_of(levels).read(mercury(60.0 - over_px, 50, tip_from=60.0, levels=levels)[None], np.zeros(1))

    assert found["flap_deg"].status is Status.MISSING


@pytest.mark.parametrize("levels", [(20.0, 85.0), (85.0, 20.0)])
def test_a_blurred_end_of_a_bar_is_not_doubted_if_it_is_drawn_there(levels: tuple[float, float]) -> None:
    """Its learned pointer covers a pixel or two more of the scale, or less, than the bar does."""
    (found,) = mercury_of(levels).read(mercury(80.0, 50, levels=levels)[None], np.zeros(1))

    assert found["flap_deg"].status is Status.READ
    assert found["flap_deg"].sigma_deg == pytest.approx(0.5, abs=0.15)


def test_a_bright_bar_in_a_black_slot_is_read_through_haze_and_without() -> None:
    """The black is several times darker in a clear frame, or brighter in a hazy one, but the bar is as it was."""
    levels = (210.0, 15.0)
    clear, hazy = (mercury(112.0, 50, levels=levels) + offset for offset in (-12.0, 40.0))
    found = mercury_of(levels).read(np.stack([clear, hazy]), np.zeros(2))

    assert [own["flap_deg"].status for own in found] == [Status.READ] * 2
