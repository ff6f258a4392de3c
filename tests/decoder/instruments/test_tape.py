"""Tapes and drums are read as far as a flight shows them; parts never seen, or alike, are not read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import cv2
import numpy as np
import pytest

from decoder.instruments.kinds.windows.tape import DrawnTape, TapeReader
from decoder.instruments.kinds.windows.tape_learning import first_tape, learn_tape
from decoder.instruments.kinds.windows.tape_picture import TapePicture
from decoder.instruments.reading import Reading, Status
from decoder.panel.arrays import Floats
from decoder.panel.gauge import Gauge
from tests.decoder.instruments.straight import WindowGrid, bar, gauge_of, seen

RADIUS_PX, MIDDLE_PX, INDEX_PX = 44.0, 60.0, 56.0
CORNERS = [[20.0, 10.0], [92.0, 10.0], [92.0, 46.0], [20.0, 46.0]]
DRAWN_AT = 40.0
BLOCK_DEG = 30.0


def numeral(block: Floats, part: Floats, y: Floats, kinds: int) -> Floats:
    """Blots in place of a numeral: two in each block, with a shape for each number."""
    digits = np.random.default_rng(5).uniform(0.2, 1.0, (kinds, 2, 3))
    which = np.mod(block, kinds).astype(np.intp)
    blots = np.zeros_like(part)
    for across in (0, 1):
        for down in (0, 1, 2):
            place = bar((part - 0.42 - 0.16 * across) * BLOCK_DEG, 1.9, 1.0) * bar(y - 17.0 - 5.0 * down, 2.0, 1.0)
            blots += digits[which, across, down] * place
    return blots


def tape_levels(values: Floats, y: Floats, kinds: int) -> Floats:
    """A dark tape with bright numerals each 30 and ticks each 5."""
    block, part = np.floor(values / BLOCK_DEG), np.mod(values / BLOCK_DEG, 1.0)
    tick = bar(np.mod(values + 2.5, 5.0) - 2.5, 0.5, 0.6) * (np.abs(y - 38.0) < 4.0)
    return 50.0 + 150.0 * numeral(block, part, y, kinds) + 60.0 * tick


def drum(heading: float, grid: WindowGrid, seed: int = 0, *, kinds: int = 12, light: float = 1.0) -> Floats:
    """A compass card seen from its rim behind a bright lubber line: values fall to the right."""

    def levels(x: Floats, y: Floats) -> Floats:
        part = (x - MIDDLE_PX) / RADIUS_PX
        at_index = math.degrees(math.asin((INDEX_PX - MIDDLE_PX) / RADIUS_PX))
        turned = np.degrees(np.arcsin(np.clip(part, -1.0, 1.0)))
        card = tape_levels(heading - (turned - at_index), y, kinds) * (0.6 + 0.4 * np.cos(np.radians(turned)))
        line = bar(x - INDEX_PX, 1.2, 0.8)
        return line * 240.0 + (1.0 - line) * card

    return seen(grid, levels, seed, gain=light)


def marks_at(heading: float, off_px: float = 0.0) -> list[list[object]]:
    """Places of the visible marks, every 5 degrees, as a hand may draw them."""
    at_index = math.asin((INDEX_PX - MIDDLE_PX) / RADIUS_PX)
    told: list[list[object]] = []
    for number, value in enumerate(range(-30, 40, 10)):
        x = MIDDLE_PX + RADIUS_PX * math.sin(at_index - math.radians(value))
        told.append([[x + off_px * (-1) ** number, 38.0], (heading + value) % 360.0])
    return told


def compass(off_px: float = 0.0) -> tuple[Gauge, WindowGrid]:
    """A compass as described, its marks drawn this far off."""
    tape = {"name": "heading_deg", "moves": "across", "index": [INDEX_PX, 38.0], "turn": 360, "drum": True}
    return gauge_of(CORNERS, tape={**tape, "marks": marks_at(DRAWN_AT, off_px)})


def learned(gauge: Gauge, grid: WindowGrid, headings: Floats, kinds: int = 12) -> TapePicture:
    """A compass that was drawn at one heading, taught by frames at others."""
    own = DrawnTape.of(gauge, grid)
    first = first_tape(own.marks, own.turn, own.along(drum(DRAWN_AT, grid, kinds=kinds)), is_round=own.is_round)
    frames = [drum(h, grid, n + 1, kinds=kinds, light=0.6 + 0.03 * (n % 9)) for n, h in enumerate(headings.tolist())]
    return learn_tape([own.along(frame) for frame in frames], first, own.marks)


def read(gauge: Gauge, grid: WindowGrid, picture: TapePicture, *frames: Floats) -> list[Reading]:
    """The compass in frames."""
    found = TapeReader(gauge, grid, picture).read(np.stack(frames), np.zeros(len(frames)))
    return [one["heading_deg"] for one in found]


def errors(found: list[Reading], headings: Floats) -> tuple[Floats, Floats, Floats]:
    """Errors of those that were read, their sigmas, and which were read."""
    is_read = np.array([one.status is Status.READ for one in found])
    off = np.array([one.angle_deg for one in found]) - headings
    off = (off + 180.0) % 360.0 - 180.0
    return off[is_read], np.array([one.sigma_deg for one in found])[is_read], is_read


@pytest.mark.parametrize("off_px", [0.0, 0.4])
def test_it_is_read_as_far_as_the_flight_shows_it(off_px: float) -> None:
    """From one picture and some frames a part of the card is known, and read well within sigma; the rest is missing."""
    gauge, grid = compass(off_px)
    picture = learned(gauge, grid, np.linspace(0.0, 130.0, 16))
    headings = np.arange(3.0, 360.0, 13.0)
    off, sigma, is_read = errors(read(gauge, grid, picture, *(drum(h, grid, 77) for h in headings.tolist())), headings)

    assert is_read[(headings > 0.0) & (headings < 130.0)].mean() >= 0.9
    assert not is_read[(headings > 205.0) & (headings < 290.0)].any()
    assert np.abs(off).max() < 3.0
    assert (np.abs(off) < 1.96 * sigma).mean() >= 0.9


def test_what_looks_alike_everywhere_is_not_told() -> None:
    """On a card with equal numerals no heading is read, except near that of the panel picture."""
    gauge, grid = compass()
    picture = learned(gauge, grid, np.linspace(40.0, 250.0, 16), kinds=1)
    headings = np.arange(0.0, 360.0, 17.0)
    off, _, _ = errors(read(gauge, grid, picture, *(drum(h, grid, 7, kinds=1) for h in headings.tolist())), headings)

    assert (np.abs(off) < 3.0).all()


def test_a_card_that_never_turned_is_not_told_from_its_line() -> None:
    """Without frames that show it elsewhere there is no reading far from where it was drawn."""
    gauge, grid = compass()
    picture = learned(gauge, grid, np.full(16, DRAWN_AT))
    off, _, _ = errors(read(gauge, grid, picture, drum(150.0, grid, 3), drum(220.0, grid, 4)), np.array([150.0, 220.0]))

    assert not off.size


def dense(at: int, seed: int) -> Floats:
    """A window with a broad band of dense print, before which a line crosses it in light of its own (along, across)."""
    own, along = np.random.default_rng(seed), np.arange(at, at + 72)
    strokes = np.repeat(np.random.default_rng(5).uniform(size=(200, 16)) > 0.2, 2, axis=0)[along]
    is_numeral = np.abs(along % 24 - 11.5)[:, None] < 10.0
    window = np.full((72, 36), 50.0)
    window[:, 8:24] += 150.0 * (strokes & is_numeral)
    window[32:35] = 50.0 + 150.0 * own.uniform(0.8, 1.2)
    return np.asarray(window + own.normal(0.0, 1.5, window.shape), np.float32)


def test_a_line_before_dense_print_stands_still_all_the_way_across() -> None:
    """Blurred print shows at its flanks, and the sun lights it otherwise, but nothing passes before it."""
    gauge, grid = compass()
    own = DrawnTape.of(gauge, grid)
    first = first_tape(own.marks, own.turn, dense(0, 0), is_round=own.is_round)
    picture = learn_tape([dense(20 * number, number + 1) for number in range(16)], first, own.marks)

    assert not picture.free[33].any()
    assert picture.free.mean() > 0.8


def test_frames_beside_it_change_nothing() -> None:
    """A frame is read the same to the bit, whatever frames are read with it."""
    gauge, grid = compass()
    picture = learned(gauge, grid, np.linspace(20.0, 80.0, 12))
    frames = [drum(h, grid, 9) for h in (25.0, 52.0, 77.0, 200.0)]

    assert [read(gauge, grid, picture, frame)[0] for frame in frames] == read(gauge, grid, picture, *frames)


def altitude(value: float, grid: WindowGrid, seed: int = 0) -> Floats:
    """A flat tape: higher values further up, four to a pixel, numerals each 120."""

    def levels(x: Floats, y: Floats) -> Floats:
        values = (value + 4.0 * (50.0 - y)) / 4.0
        line = bar(y - 50.0, 1.0, 0.8) * (x < 14.0)
        return line * 230.0 + (1.0 - line) * tape_levels(values, x - 5.0, 60)

    return seen(grid, levels, seed)


FLAT = [[10.0, 10.0], [50.0, 10.0], [50.0, 90.0], [10.0, 90.0]]


def lined(value: float, grid: WindowGrid, line: float, seed: int = 0) -> Floats:
    """A flat tape as screens show it, four to a pixel: even ticks on a line, small numerals, values rising upwards."""

    def levels(x: Floats, y: Floats) -> Floats:
        values = (value + 4.0 * (50.0 - y)) / 4.0
        number = numeral(np.floor(values / BLOCK_DEG), np.mod(values / BLOCK_DEG, 1.0), x - 8.0, 60)
        tick = bar(np.mod(values + 5.0, 10.0) - 5.0, 0.7, 0.8) * (x < 22.0) * (x > 15.0)
        return 30.0 + 90.0 * number + 180.0 * np.maximum(tick, line * bar(x - 15.0, 1.2, 0.8))

    return seen(grid, levels, seed)


def flown(
    window: Callable[[float, WindowGrid, int], Floats],
    climb: tuple[float, float] = (1000.0, 2200.0),
    at: Sequence[float] = tuple(range(1010, 2200, 97)),
    frames: int = 16,
) -> list[tuple[Reading, float]]:
    """What a flat tape that was learned in a climb shows at other heights, with the truth."""
    marks = [[30.0, 1080.0], [50.0, 1000.0], [80.0, 880.0]]
    gauge, grid = gauge_of(FLAT, tape={"name": "heading_deg", "index": 50.0, "marks": marks})
    own = DrawnTape.of(gauge, grid)
    first = first_tape(own.marks, own.turn, own.along(window(1000.0, grid, 0)), is_round=False)
    seen_at = enumerate(np.linspace(*climb, frames).tolist())
    picture = learn_tape([own.along(window(height, grid, n)) for n, height in seen_at], first, own.marks)
    found = read(gauge, grid, picture, *(window(height, grid, 50) for height in at))
    return list(zip(found, at, strict=True))


def test_a_flat_tape_goes_on_as_far_as_it_was_seen() -> None:
    """An altitude tape without an end is read frame by frame beyond what the panel picture shows, above and below."""
    *found, (beyond, _) = flown(altitude, (700.0, 1700.0), (712.0, 985.0, 1010.0, 1234.0, 1490.0, 1650.0, 3000.0))

    assert {one.status for one, _ in found} == {Status.READ}
    assert all(abs(one.angle_deg - height) < 1.96 * one.sigma_deg for one, height in found)
    assert beyond.status is Status.MISSING


def numbered(value: float, grid: WindowGrid, seed: int = 0) -> Floats:
    """A flat tape, four to a pixel, of which no two numerals are alike."""

    def levels(x: Floats, y: Floats) -> Floats:
        return 50.0 + 100.0 * tape_levels((value + 4.0 * (50.0 - y)) / 4.0, x - 5.0, 400) / 150.0

    return seen(grid, levels, seed)


@pytest.mark.slow
def test_a_flat_tape_is_followed_as_far_as_the_flight_goes() -> None:
    """Eight windows away from the panel picture, its light is what it was there, and the tape's ends have not met."""
    found = flown(numbered, (1000.0, 3600.0), tuple(range(1010, 3600, 97)), 32)

    assert {one.status for one, _ in found} == {Status.READ}
    assert all(abs(one.angle_deg - height) < 1.96 * one.sigma_deg for one, height in found)


def shaken(value: float, grid: WindowGrid, seed: int = 0) -> Floats:
    """The same, from a camera that moved by two pixels along a diagonal during some exposures."""
    diagonal = np.eye(3, dtype=np.float32)[:: 1 if seed % 2 else -1] / 3.0
    sharp = numbered(value, grid, seed)
    return sharp if seed % 5 == 0 else np.asarray(cv2.filter2D(sharp, -1, diagonal), np.float32)


def test_a_flat_tape_is_read_in_frames_that_are_less_sharp_than_the_panel_picture() -> None:
    """What blur changes along a numeral's strokes is no other digit."""
    found = flown(shaken, (1000.0, 2200.0), tuple(range(1010, 2200, 97)), 32)

    assert {one.status for one, _ in found} == {Status.READ}
    assert all(abs(one.angle_deg - height) < 1.96 * one.sigma_deg for one, height in found)


@pytest.mark.parametrize("line", [0.0, 1.0])
def test_a_line_along_the_ticks_makes_no_two_parts_look_alike(line: float) -> None:
    """A bright line along all ticks is in every picture, wherever the tape is: it does not indicate a place."""
    found = flown(lambda value, grid, seed: lined(value, grid, line, seed))

    assert {one.status for one, _ in found} == {Status.READ}
    assert all(abs(one.angle_deg - a) < 1.96 * one.sigma_deg for one, a in found)


def placarded(value: float, grid: WindowGrid, seed: int = 0) -> Floats:
    """A bright flat tape with few dark numerals, and the end of a black placard over a corner of its window."""

    def levels(x: Floats, y: Floats) -> Floats:
        values = (value + 4.0 * (50.0 - y)) / 4.0
        number = numeral(np.floor(values / BLOCK_DEG), np.mod(values / BLOCK_DEG, 1.0), x - 8.0, 60)
        tick = bar(np.mod(values + 7.5, 15.0) - 7.5, 0.5, 0.8) * (x < 20.0)
        tape = 225.0 - 90.0 * number - 40.0 * tick
        return np.where((x > 30.0) & (y < 26.0), 20.0, tape)

    return seen(grid, levels, seed)


def test_what_lies_over_a_corner_of_a_tape_does_not_tell_where_it_is() -> None:
    """A black placard outweighs all that moves beside it, and is where it was in every frame."""
    found = flown(placarded)
    told = [(one, a) for one, a in found if one.status is Status.READ]

    assert len(told) >= 0.8 * len(found)
    assert all(abs(one.angle_deg - a) < 3.0 * one.sigma_deg for one, a in told)


SCREEN = [[10.0, 10.0], [60.0, 10.0], [60.0, 210.0], [10.0, 210.0]]
SCREEN_INDEX = [58.0, 110.0]
PX_PER_KT = 4.0
KNOWN_KT = np.linspace(90.0, 115.0, 16)


def speed_tape(
    speed_kt: float, grid: WindowGrid, seed: int, *, readout: bool, contrast: float, framed: bool = False
) -> Floats:
    """A screen's airspeed tape with a mark every 5 kt, behind a box whose digits change with it, and in a frame."""

    def levels(x: Floats, y: Floats) -> Floats:
        down_px = y - SCREEN_INDEX[1]
        at_kt = speed_kt - down_px / PX_PER_KT
        tick = bar((np.mod(at_kt + 2.5, 5.0) - 2.5) * PX_PER_KT, 0.8, 0.6) * (np.abs(x - 52.0) < 6.0)
        block, part = np.floor(at_kt / 10.0 + 0.5), np.mod(at_kt / 10.0 + 0.5, 1.0)
        digits = np.random.default_rng(5).uniform(0.2, 1.0, (40, 3, 2))
        which = np.mod(block, 40).astype(np.intp)
        blots = np.zeros_like(x)
        for across in range(3):
            for below in range(2):
                place = bar((part - 0.5) * 10 * PX_PER_KT + 4.0 - 8.0 * below, 2.0, 1.0)
                blots += digits[which, across, below] * place * bar(x - 20.0 - 7.0 * across, 2.0, 1.0)
        tape = 50.0 + 150.0 * contrast * blots + 150.0 * np.maximum(tick, bar(x - 58.0, 1.0, 0.6))
        if framed:
            tape = np.where((np.abs(down_px) > 94.0) & (np.abs(down_px) < 97.0) | (np.abs(down_px) < 1.5), 215.0, tape)
        if not readout:
            return tape
        number = np.random.default_rng(1000 + round(speed_kt))
        figures = np.zeros_like(x)
        for across in range(3):
            for below in range(4):
                place = bar(down_px + 6.0 - 4.0 * below, 2.0, 0.8) * bar(x - 16.0 - 9.0 * across, 3.0, 0.8)
                figures += number.uniform() * place
        is_box = (np.abs(down_px) < 15.0) & (x < 46.0)
        is_frame = is_box & ((np.abs(down_px) > 13.0) | (x > 44.0))
        return np.where(is_frame, 220.0, np.where(is_box, 50.0 + 200.0 * figures, tape))

    return seen(grid, levels, seed)


def read_speeds(speeds_kt: Floats, *, readout: bool, contrast: float, framed: bool = False) -> tuple[Floats, Floats]:
    """Errors of those that were read, and which were read, of a tape that a flight showed between 90 and 115 kt."""
    marks = [[[52.0, SCREEN_INDEX[1] - (kt - 100) * PX_PER_KT], float(kt)] for kt in range(80, 121, 10)]
    gauge, grid = gauge_of(SCREEN, tape={"name": "heading_deg", "moves": "down", "index": SCREEN_INDEX, "marks": marks})
    own = DrawnTape.of(gauge, grid)
    panel = speed_tape(100.0, grid, 0, readout=readout, contrast=contrast, framed=framed)
    frames = [
        speed_tape(kt, grid, n + 1, readout=readout, contrast=contrast, framed=framed)
        for n, kt in enumerate(KNOWN_KT.tolist())
    ]
    first = first_tape(own.marks, own.turn, own.along(panel), is_round=own.is_round)
    picture = learn_tape([own.along(frame) for frame in frames], first, own.marks)
    shown = (
        speed_tape(kt, grid, 700 + n, readout=readout, contrast=contrast, framed=framed)
        for n, kt in enumerate(speeds_kt.tolist())
    )
    off, _, is_read = errors(read(gauge, grid, picture, *shown), speeds_kt)
    return off, is_read


@pytest.mark.slow
@pytest.mark.parametrize(("readout", "framed"), [(True, False), (False, True)], ids=["a box", "a frame"])
def test_what_lies_over_a_tape_does_not_keep_it_from_being_read(*, readout: bool, framed: bool) -> None:
    """Digits in a box changed as much as the tape did, but not as it did; a frame and an index stand still."""
    off, is_read = read_speeds(np.arange(91.0, 115.0, 1.7), readout=readout, contrast=1.0, framed=framed)

    assert is_read.mean() >= 0.8
    assert np.abs(off).max() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("contrast", "readout"), [(0.2, True), (0.4, False), (0.6, False), (1.0, True)])
def test_tape_with_faint_numerals_is_never_read_a_numeral_off(contrast: float, *, readout: bool) -> None:
    """What the flight never showed looked like what it did, but for a numeral."""
    off, _ = read_speeds(np.arange(60.0, 150.0, 1.7), readout=readout, contrast=contrast)

    assert off[np.abs(off) > 1.0].tolist() == []
