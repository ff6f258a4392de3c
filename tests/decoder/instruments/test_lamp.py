"""Lamps: lit or not, whatever light falls on the panel; and in doubt, nothing."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.unwrapping import WindowGrid
from decoder.instruments.kinds.windows.lamp import (
    LampPicture,
    LampReader,
    SurroundedLampReader,
    first_lamp,
    first_surrounded,
    learn_lamp,
    learn_surrounded,
)
from decoder.instruments.reading import Reading, Status
from decoder.panel.arrays import Floats
from decoder.panel.kinds.lamp import Lamp
from decoder.panel.written import BOOLEAN, ValueType, Written

GRID = WindowGrid.of(((20.0, 20.0), (44.0, 20.0), (44.0, 40.0), (20.0, 40.0)), 0.5)
LAMP = Lamp(name="low_fuel_on", light="low_fuel_light_pct")


def drawn(light: float, *, sun: float = 1.0, slope: float = 0.0, seed: int = 0, legend: bool = False) -> Floats:
    """A lamp that adds so many grey levels, in its bezel beside print; the sun may come from one side, (R, C)."""
    noise = np.random.default_rng(seed).normal(0.0, 2.0, (GRID.rows, GRID.columns))
    down, across = np.indices((GRID.rows, GRID.columns))
    panel = 60.0 + 12.0 * np.sin(across / 2.0) * (down < 6)
    inside = np.zeros_like(panel)
    inside[GRID.within] = 1.0
    y, x = down - (GRID.rows - 1) / 2, across - (GRID.columns - 1) / 2
    disc = np.hypot(x / 10.0, y / 8.0) < 1.0
    lit = disc & (np.abs(np.sin(across)) < 0.5) if legend else disc
    panel = np.where(disc, 25.0, np.where(inside > 0, 110.0, panel))
    shade = sun * (1.0 + slope * x / GRID.columns)
    return np.clip(panel * shade + light * lit + noise, 0.0, 255.0).astype(np.float32)


def glowing(light: float, *, sun: float = 1.0, seed: int = 0) -> Floats:
    """A lamp that lights the panel around it too, less the further away."""
    y, x = (
        np.indices((GRID.rows, GRID.columns)) - np.array([(GRID.rows - 1) / 2, (GRID.columns - 1) / 2])[:, None, None]
    )
    return drawn(light, sun=sun, seed=seed) + (0.3 * light * np.exp(-np.hypot(x, y) / 10.0)).astype(np.float32)


def haloed(light: float, *, sun: float = 1.0, seed: int = 0) -> Floats:
    """A lamp that fills its window on a dark plain panel, within a halo that fades over a tenth of its diameter."""
    down, across = np.indices((GRID.rows, GRID.columns))
    beyond = np.hypot(across - (GRID.columns - 1) / 2, down - (GRID.rows - 1) / 2) - min(GRID.rows, GRID.columns) / 4
    noise = np.random.default_rng(seed).normal(0.0, 1.0, down.shape)
    halo = 0.5 * light * np.exp(-np.maximum(beyond, 0.0) / 4.0)
    return np.clip(np.where(beyond < 0.0, 50.0 * sun + light, 30.0 * sun + halo) + noise, 0, 255).astype(np.float32)


def glass(light: float, *, haze: float = 0.0, beside: int = 0, seed: int = 0) -> Floats:
    """Words behind black glass, so many cells below their window, blurred onto the glass around them."""
    words = np.zeros((GRID.rows, GRID.columns), np.float32)
    rows, columns = GRID.within
    words[rows.start + 2 + beside : rows.stop - 2 + beside, columns.start + 1 : columns.stop - 1 : 3] = light
    noise = np.random.default_rng(seed).normal(0.0, 1.5, words.shape).astype(np.float32) if seed else 0.0
    return np.clip(cv2.GaussianBlur(words, (0, 0), 1.0) + haze + noise, 0.0, 255.0)


def plain(light: float, *, sun: float = 1.0, seed: int = 0) -> Floats:
    """A lamp in its bezel with no print beside it."""
    frame = drawn(light, sun=sun, seed=seed)
    frame[:6] = frame[-6:]
    return frame


def card(seed: int) -> Floats:
    """A pale card over the window and all around it."""
    return np.random.default_rng(seed).normal(145.0, 2.0, (GRID.rows, GRID.columns)).astype(np.float32)


def led(light: float, *, sun: float = 1.0, seed: int = 0) -> Floats:
    """A pale lens, as good as white in the sun, that is white when lit."""
    lens = cv2.GaussianBlur((drawn(0.0) < 40.0).astype(np.float32), (0, 0), 1.0)
    return np.clip(glowing(light, sun=sun, seed=seed) + 170.0 * sun * lens, 0.0, 255.0)


def sample(*lights: float) -> list[Floats]:
    """Frames in changing sun."""
    return [drawn(light, sun=0.5 + 0.07 * number, seed=number + 1) for number, light in enumerate(lights)]


def read(picture: LampPicture, *frames: Floats, lamp: Lamp = LAMP) -> list[dict[str, Reading]]:
    """The lamp in frames."""
    return LampReader(lamp, GRID, picture).read(np.stack(frames), np.zeros(len(frames)))


TAUGHT = learn_lamp(LAMP, GRID, sample(*[0.0] * 12), first_lamp(LAMP, GRID, drawn(0.0)))


@given(
    light=st.sampled_from([0.0, 60.0, 120.0]),
    sun=st.floats(0.4, 1.3),
    slope=st.floats(-0.4, 0.4),
    seed=st.integers(0, 99),
)
@settings(max_examples=30, deadline=None)
def test_the_sun_lights_no_lamp(light: float, sun: float, slope: float, seed: int) -> None:
    """A lamp's state is read, wherever the sun comes from, though no frame of the sample showed it lit."""
    (found,) = read(TAUGHT, drawn(light, sun=sun, slope=slope, seed=seed))

    assert found["low_fuel_on"].status is Status.READ
    assert found["low_fuel_on"].angle_deg == float(light > 0)


@pytest.mark.parametrize("legend", [False, True], ids=["whole", "words that light up"])
def test_how_bright_it_is(*, legend: bool) -> None:
    """Its light is reported in percent of white, and more light is more."""
    told = [
        read(TAUGHT, drawn(light, seed=7, legend=legend))[0]["low_fuel_light_pct"].angle_deg for light in (40, 80, 120)
    ]

    assert told == sorted(told)
    assert told[2] - told[1] == pytest.approx(told[1] - told[0], rel=0.1)


def test_what_a_flight_showed_lit_is_told_nearer_to_it() -> None:
    """A dim lamp shown lit by the sample is lit at that light, and no state is read halfway."""
    taught = learn_lamp(LAMP, GRID, sample(*[0.0] * 8, *[45.0] * 4), first_lamp(LAMP, GRID, drawn(0.0)))
    dim, half, dark = (found["low_fuel_on"] for found in read(taught, drawn(40.0), drawn(14.0), drawn(0.0)))

    assert (dim.status, dim.angle_deg) == (Status.READ, 1.0)
    assert half.status is Status.MISSING
    assert (dark.status, dark.angle_deg) == (Status.READ, 0.0)


@pytest.mark.parametrize("part", [0.3, 0.5, 0.7, 0.9])
def test_a_lamp_that_dims_with_the_panel_is_never_told_wrongly(part: float) -> None:
    """A camera that exposes for a brighter scene dims lamp and panel alike; a lamp that is often off is read, too."""
    gains = 0.45 + 0.04 * np.random.default_rng(3).permutation(16)
    lights = 45.0 * gains * (np.random.default_rng(4).permutation(16) < 16 * part)
    frames = [
        drawn(light, sun=gain, seed=seed) for seed, (light, gain) in enumerate(zip(lights, gains, strict=True), 1)
    ]
    taught = learn_lamp(LAMP, GRID, frames, first_lamp(LAMP, GRID, drawn(0.0)))
    dim, dark = (found["low_fuel_on"] for found in read(taught, drawn(22.5, sun=0.5, seed=50), drawn(0.0, sun=0.5)))

    assert dim.status is Status.MISSING or dim.angle_deg == 1.0
    assert dark.status is Status.MISSING or dark.angle_deg == 0.0
    assert part > 0.5 or (dim.status, dark.status) == (Status.READ, Status.READ)


def test_a_lamp_seen_lit_by_day_is_not_called_off_at_night() -> None:
    """Nothing tells whether its light dims along with the panel: where that would hide it, nothing is read."""
    gains, is_lit = [0.75] * 8 + [0.15] * 8, [False] * 4 + [True] * 4 + [False] * 8
    frames = [
        drawn(45.0 * on, sun=gain, seed=seed) for seed, (gain, on) in enumerate(zip(gains, is_lit, strict=True), 1)
    ]
    taught = learn_lamp(LAMP, GRID, frames, first_lamp(LAMP, GRID, drawn(0.0)))
    night, day = (found["low_fuel_on"] for found in read(taught, drawn(0.0, sun=0.1), drawn(0.0, sun=0.75)))

    assert night.status is Status.MISSING
    assert (day.status, day.angle_deg) == (Status.READ, 0.0)


def test_a_lamp_drawn_lit_goes_out() -> None:
    """The panel picture may show it lit; then what is darker is off."""
    lamp = Lamp(name="low_fuel_on", lit=True)
    taught = learn_lamp(lamp, GRID, sample(*[90.0] * 12), first_lamp(lamp, GRID, drawn(90.0)))
    on, off = (found["low_fuel_on"] for found in read(taught, drawn(90.0, sun=0.7), drawn(0.0), lamp=lamp))

    assert (on.status, on.angle_deg, off.status, off.angle_deg) == (Status.READ, 1.0, Status.READ, 0.0)


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("part", [0.3, 0.5, 0.7])
def test_a_lamp_that_is_lit_half_of_the_time_is_never_told_wrongly(part: float, *, lit: bool) -> None:
    """However often the sample shows either state, and though it lights what is around it: right, or nothing."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    lights = 90.0 * (np.arange(20) < 20 * part)
    frames = [glowing(light, seed=number + 1) for number, light in enumerate(lights.tolist())]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, glowing(90.0 * lit)))
    on, off = (found["low_fuel_on"] for found in read(taught, glowing(90.0, seed=50), glowing(0.0, seed=51), lamp=lamp))

    assert (on if lit else off).status is Status.READ
    assert on.status is Status.MISSING or on.angle_deg == 1.0
    assert off.status is Status.MISSING or off.angle_deg == 0.0


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.5, 0.7, 1.0])
def test_words_behind_black_glass_are_read_by_their_own_light(part: float, *, lit: bool) -> None:
    """Where all is dark but the lamp, its own light around the window is not taken for the sun's."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    frames = [
        glass(light, haze=haze, seed=number)
        for number, (light, haze) in enumerate(
            zip(110.0 * (np.arange(20) < 20 * part), [0.0, 4.0, 30.0, 0.0] * 5, strict=True)
        )
    ]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, glass(110.0 * lit)))
    found = read(taught, glass(110.0), glass(100.0, haze=20.0, seed=50), glass(0.0), glass(0.0, haze=20.0), lamp=lamp)

    assert [own["low_fuel_on"].status for own in found] == [Status.READ] * 4
    assert [own["low_fuel_on"].angle_deg for own in found] == [1.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("light", [30.0, 60.0])
def test_a_pale_lamp_on_black_is_never_told_wrongly(light: float, part: float, *, lit: bool) -> None:
    """A lamp that is bright when it is off, with nothing around it to tell of the sun: right, or nothing."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    rng = np.random.default_rng(11)

    def pale(light: float, exposure: float = 1.0) -> Floats:
        frame = glass(0.0)
        frame[GRID.within] = 130.0 + light
        return np.clip(exposure * frame + rng.normal(0.0, 1.5, frame.shape), 0.0, 255.0).astype(np.float32)

    lights = light * (np.arange(20) < 20 * part)
    frames = [pale(own, rng.uniform(0.95, 1.05)) for own in lights.tolist()]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, pale(light * lit)))

    for own in (0.0, light) * 5:
        (found,) = read(taught, pale(own, rng.uniform(0.95, 1.05)), lamp=lamp)
        assert found["low_fuel_on"].status is Status.MISSING or found["low_fuel_on"].angle_deg == float(own > 0)


@pytest.mark.parametrize("lit", [False, True])
def test_a_lamp_beside_another_is_read_by_itself(*, lit: bool) -> None:
    """What comes and goes around a window, such as the next lamp or a display, is no light on the panel."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    rng = np.random.default_rng(5)

    def row(own: float, next_: float, seed: int = 0) -> Floats:
        there = glass(own, seed=seed)
        there[:, -GRID.margin + 3 :] += glass(next_)[:, GRID.margin : 2 * GRID.margin - 3]
        return there

    frames = [row(*110.0 * rng.integers(0, 2, 2), seed=number + 1) for number in range(20)]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, row(110.0 * lit, 0.0)))

    for own, next_ in product((0.0, 110.0), repeat=2):
        (found,) = read(taught, row(own, next_, seed=60), lamp=lamp)
        assert (found["low_fuel_on"].status, found["low_fuel_on"].angle_deg) == (Status.READ, float(own > 0))


@pytest.mark.parametrize("lit", [False, True])
def test_a_lamp_within_a_halo_of_its_own_light_is_read_in_both_states(*, lit: bool) -> None:
    """Where nothing else shows around its window, the halo's coming and going is most of what is seen there."""
    lamp = Lamp(name="fire_on", lit=lit)
    lights = [150.0 * ((number % 8 < 5) == lit) for number in range(16)]
    views = [haloed(light, sun=0.9 + 0.01 * number, seed=number) for number, light in enumerate(lights)]
    first = first_surrounded(lamp, GRID, haloed(150.0 * lit, seed=50))
    reader = SurroundedLampReader(lamp, GRID, learn_surrounded(lamp, GRID, views, first))

    told = [own["fire_on"] for own in reader.read(np.stack(views), np.zeros(16))]

    assert [own.status for own in told] == [Status.READ] * 16
    assert [bool(own.angle_deg) for own in told] == [light > 0 for light in lights]


@pytest.mark.parametrize("beside", range(2, 20, 2))
def test_a_window_drawn_beside_its_lamp_is_read_right_or_not_at_all(beside: int) -> None:
    """A window that shows less light than any lamp adds, though it is lit, does not show the lamp."""
    lamp = Lamp(name="low_fuel_on", lit=True)
    lights = [110.0, 0.0] * 8
    frames = [glass(light, beside=beside, seed=number + 1) for number, light in enumerate(lights)]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, glass(110.0, beside=beside)))
    found = [own["low_fuel_on"] for own in read(taught, *frames, lamp=lamp)]

    for own, light in zip(found, lights, strict=True):
        assert own.status is Status.MISSING or own.angle_deg == float(light > 0)


@pytest.mark.parametrize("lit", [False, True])
def test_a_panel_that_has_its_state_wrong_tells_nothing(*, lit: bool) -> None:
    """If a flight shows it darker than the stated off, or brighter than the stated lit, nothing is read."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    shown, other = (0.0, 90.0) if lit else (90.0, 0.0)
    taught = learn_lamp(lamp, GRID, sample(*[shown] * 8, *[other] * 4), first_lamp(lamp, GRID, drawn(shown)))

    assert {found["low_fuel_on"].status for found in read(taught, drawn(0.0), drawn(90.0), lamp=lamp)} == {
        Status.MISSING
    }


def test_what_lies_over_it_makes_it_missing() -> None:
    """A hand over window and surroundings, or a shadow's edge across it, make it missing."""
    hand = drawn(0.0)
    hand[:, : GRID.columns * 2 // 3] = np.random.default_rng(3).normal(
        170.0, 25.0, hand[:, : GRID.columns * 2 // 3].shape
    )
    reflected = drawn(0.0)
    reflected[GRID.within[0].start - 4 : GRID.rows // 2 + 2, GRID.within[1].start - 4 : GRID.columns // 2] += 90.0

    for found in read(TAUGHT, hand, reflected):
        assert found["low_fuel_on"].status is Status.MISSING or found["low_fuel_on"].angle_deg == 0.0


def test_a_white_lamp_in_glare_is_not_lit() -> None:
    """A lens that glare makes as white as its lamp does is not read; in dull light it is off."""
    lamp = Lamp(name="low_fuel_on", lit=True)
    suns, is_lit = [0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 0.8, 0.7, 0.8, 0.9, 1.3, 1.35], [True] * 7 + [False] * 5
    frames = [led(120.0 * on, sun=sun, seed=seed) for seed, (sun, on) in enumerate(zip(suns, is_lit, strict=True), 1)]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, led(120.0)))

    glare = [led(0.0, sun=sun, seed=50) for sun in (0.8, 1.0, 1.2, 1.3, 1.4, 1.5)]
    dull, *off = (own["low_fuel_on"] for own in read(taught, *glare, lamp=lamp))

    assert (dull.status, dull.angle_deg) == (Status.READ, 0.0)
    assert all(own.status is Status.MISSING or own.angle_deg == 0.0 for own in off)


def test_a_lit_lamp_that_a_shorter_exposure_dims_is_not_off() -> None:
    """A lamp that was lit in the panel picture is not off where a shorter exposure dims it along with the panel."""

    def bulb(light: float, exposure: float = 1.0, seed: int = 0) -> Floats:
        frame = np.full((GRID.rows, GRID.columns), 60.0)
        frame[[0, 2, 4, -1, -3, -5]] = 90.0
        frame[GRID.within] += light
        return (exposure * frame + np.random.default_rng(seed).normal(0.0, 2.0, frame.shape)).astype(np.float32)

    lamp, lit = Lamp(name="low_fuel_on", lit=True), [0.9, 0.9, 0.6, 0.5, 0.4, 0.4, 0.4]
    shots = [*((80.0, exposure) for exposure in lit), *((0.0, exposure) for exposure in np.linspace(0.3, 1.0, 9))]
    frames = [bulb(*shot, seed) for seed, shot in enumerate(shots, 1)]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, bulb(80.0)))
    states = [own["low_fuel_on"] for own in read(taught, *frames, lamp=lamp)]

    assert all(own.status is Status.MISSING or own.angle_deg == 1.0 for own in states[: len(lit)])
    assert [(own.status, own.angle_deg) for own in states[len(lit) :]] == [(Status.READ, 0.0)] * 9


@pytest.mark.parametrize("lit", [False, True])
def test_a_card_over_it_for_a_while_costs_no_other_frame(*, lit: bool) -> None:
    """Frames in which it is covered are missing, and all others are read, in either state."""
    lamp = Lamp(name="low_fuel_on", lit=lit)
    frames = [plain(80.0 * (n >= 6), sun=0.9 + 0.02 * n, seed=n + 1) for n in range(12)]
    taught = learn_lamp(lamp, GRID, [*frames, card(20), card(21)], first_lamp(lamp, GRID, plain(80.0 * lit)))
    *found, hidden = read(taught, *frames, card(22), lamp=lamp)

    assert [(own["low_fuel_on"].status, own["low_fuel_on"].angle_deg) for own in found] == [
        *[(Status.READ, 0.0)] * 6,
        *[(Status.READ, 1.0)] * 6,
    ]
    assert hidden["low_fuel_on"].status is Status.MISSING


@pytest.mark.parametrize("lit", [False, True])
def test_words_that_change_without_a_change_of_light_are_no_known_state(*, lit: bool) -> None:
    """A plate that showed other words, no brighter, was read to be in the panel picture's state throughout."""
    lamp = LAMP.model_copy(update={"lit": lit})

    def plate(seed: int, first: int) -> Floats:
        frame = plain(70.0, seed=seed)
        rows, columns = GRID.within
        frame[rows.start + 4 : rows.stop - 4, columns.start + first : columns.stop : 6] += 60.0
        return cv2.GaussianBlur(frame, (0, 0), 0.7).astype(np.float32)

    others = [number // 3 % 2 for number in range(12)]
    sampled = [plate(number + 1, 1 + 3 * other) for number, other in enumerate(others)]
    taught = learn_lamp(lamp, GRID, sampled, first_lamp(lamp, GRID, plate(0, 1)))
    found = [each[LAMP.name] for each in read(taught, *sampled, lamp=lamp)]

    assert [each.status is Status.READ for each in found] == [not other for other in others]
    assert all(each.angle_deg == float(lit) for each in found if each.status is Status.READ)


@pytest.mark.parametrize("lit", [False, True])
def test_glare_on_its_glass_is_no_light_of_its_own(*, lit: bool) -> None:
    """A sample's few frames of glare on black glass are missing or right, and all others are read."""
    lamp = Lamp(name="low_fuel_on", lit=lit)

    def glaring(light: float, glare: float = 0.0, seed: int = 0) -> Floats:
        frame = glass(light, haze=25.0, seed=seed)
        frame[GRID.within] += glare
        return frame

    frames = [glaring(light, 40.0 * (n % 6 == 0), n + 1) for n, light in enumerate([0.0] * 6 + [150.0] * 12)]
    taught = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, glaring(150.0 * lit)))
    for light in (0.0, 150.0):
        clear, glare = (own["low_fuel_on"] for own in read(taught, glaring(light), glaring(light, 40.0), lamp=lamp))
        assert (clear.status, clear.angle_deg) == (Status.READ, float(light > 0))
        assert glare.status is Status.MISSING or glare.angle_deg == float(light > 0)


@pytest.mark.parametrize("light", [12.0, 20.0, 30.0, 40.0, 60.0])
def test_a_dim_legend_is_not_off_because_a_reflection_was_brighter(light: float) -> None:
    """A sample with one frame of glare tells no wrong state: thin words add less light to their window than glare."""

    def words(light: float, glare: float = 0.0, seed: int = 0) -> Floats:
        frame = glass(light, haze=60.0, seed=seed + 1)
        frame[GRID.within] += glare - 35.0
        return np.clip(frame, 0.0, 255.0)

    lights = [0.0] * 8 + [light] * 7
    frames = [words(light, seed=number) for number, light in enumerate(lights)] + [words(0.0, 45.0, 20)]
    taught = learn_lamp(LAMP, GRID, frames, first_lamp(LAMP, GRID, words(0.0)))

    found = [each["low_fuel_on"] for each in read(taught, *(words(light, seed=number) for number in range(30, 50)))]

    assert all(each.status is Status.MISSING or each.angle_deg == 1.0 for each in found)


def test_a_veil_over_half_as_bright_as_the_lamp_is_no_lamp() -> None:
    """Sunlight on the lens of an unlit lamp adds light to all of it; a lamp that shines evenly is known to add more."""
    taught = learn_lamp(LAMP, GRID, sample(*[0.0, 80.0] * 6), first_lamp(LAMP, GRID, drawn(0.0)))

    veiled, lit = (own["low_fuel_on"] for own in read(taught, drawn(48.0, seed=30), drawn(76.0, seed=31)))

    assert veiled.status is Status.MISSING
    assert (lit.status, lit.angle_deg) == (Status.READ, 1.0)


def test_a_lamp_that_is_dimmed_in_some_frames_is_read_in_all_others() -> None:
    """A dimmer, or a pulsed supply that a short exposure samples, costs those frames that are in between."""
    lights = [0.0, 120.0, 0.0, 45.0, 120.0, 0.0, 50.0, 120.0, 0.0, 40.0, 120.0, 0.0, 120.0, 0.0, 120.0, 45.0]
    frames = [drawn(light, seed=number + 1) for number, light in enumerate(lights)]
    taught = learn_lamp(LAMP, GRID, frames, first_lamp(LAMP, GRID, drawn(0.0)))

    found = [
        own["low_fuel_on"] for own in read(taught, drawn(0.0, seed=40), drawn(115.0, seed=41), drawn(45.0, seed=42))
    ]

    assert [(own.status, own.angle_deg) for own in found[:2]] == [(Status.READ, 0.0), (Status.READ, 1.0)]
    assert found[2].status is Status.MISSING


def test_frames_beside_it_change_nothing() -> None:
    """A frame is read the same to the bit, whatever frames are read with it."""
    frames = sample(0.0, 80.0, 20.0, 0.0)

    assert [read(TAUGHT, frame)[0] for frame in frames] == read(TAUGHT, *frames)


@pytest.mark.parametrize(("text", "value"), [("True", 1.0), ("FALSE", 0.0), ("", np.nan)])
def test_states_are_known_as_others_write_them(text: str, value: float) -> None:
    """A truth that a spreadsheet or a Python program wrote has capitals."""
    assert BOOLEAN.value_of(text) == pytest.approx(value, nan_ok=True)


@given(
    written=st.sampled_from(
        [
            BOOLEAN,
            Written(ValueType.TEXT, "0000"),
            Written(ValueType.TEXT, "00:00:00"),
            Written(ValueType.NUMBER, "000.00"),
        ]
    ),
    part=st.floats(0.0, 1.0),
)
def test_what_is_written_is_read_back(written: Written, part: float) -> None:
    """Every value that can be written is read back as it was."""
    low, high = written.limits
    value = round((low + part * (high - low)) / written.resolution) * written.resolution

    assert written.value_of(written.text_of(value)) == pytest.approx(value)


@pytest.mark.parametrize("lit", [False, True], ids=["off on the panel picture", "lit there"])
@pytest.mark.parametrize("light", [9.0, 12.0, 20.0])
def test_a_lamp_too_dim_to_be_told_is_never_told_wrongly(light: float, *, lit: bool) -> None:
    """At dusk a camera may show a lit lamp as hardly brighter than a dark one: its two states are not one."""
    lights = [light * (frame % 5 < 2) for frame in range(16)]
    lamp = LAMP.model_copy(update={"lit": lit})
    frames = [drawn(own, sun=0.3 - 0.01 * frame, seed=frame + 1) for frame, own in enumerate(lights)]
    picture = learn_lamp(lamp, GRID, frames, first_lamp(lamp, GRID, drawn(light * lit, sun=0.3, seed=90)))
    told = read(picture, *frames, lamp=lamp)

    assert [
        (one["low_fuel_on"].angle_deg, own)
        for one, own in zip(told, lights, strict=True)
        if one["low_fuel_on"].status is Status.READ and one["low_fuel_on"].angle_deg != float(own > 0)
    ] == []


def bulb(light: float, *, sun: float, slope: float, seed: int, beside: float = 0.0) -> Floats:
    """An even bulb of 44 px beside another one, on a panel of which (240, 240) show in uneven light."""
    y, x = np.indices((240, 240)) - 120.0
    panel = 75.0 + 20.0 * np.sin(x / 5.0) * np.sin(y / 7.0)
    own, other = np.hypot(x, y) < 22.0, (np.abs(x - 57.0) < 20.0) & (np.abs(y) < 20.0)
    panel = np.where(own | other, 45.0, panel) * sun * (1.0 + slope * x / 240.0)
    noise = np.random.default_rng(seed).normal(0.0, 2.5, panel.shape)
    return np.clip(panel + light * own + beside * other + noise, 0.0, 255.0).astype(np.float32)


@pytest.mark.parametrize("half_px", [7, 9, 13])
@pytest.mark.parametrize("light", [60.0, 180.0])
def test_a_window_inside_its_bulb_is_never_told_to_be_as_drawn_while_it_is_lit(half_px: int, light: float) -> None:
    """What is next to it brightens as much: it is missing then, and read while it is dark."""
    corner = 2.0 * half_px
    grid = WindowGrid.of(((0.0, 0.0), (corner, 0.0), (corner, corner), (0.0, corner)), Lamp.margin_part)
    rows = slice(120 - half_px - grid.margin, 120 + half_px + grid.margin)
    lit = np.arange(40) % 30 >= 15
    frames = [
        bulb(
            light * own,
            sun=1.0 + 0.4 * np.sin(number / 7.0),
            slope=0.4 * np.sin(number / 5.0),
            seed=number + 1,
            beside=110.0 * (number % 3 == 0),
        )[rows, rows]
        for number, own in enumerate(lit)
    ]
    first = first_surrounded(LAMP, grid, bulb(0.0, sun=1.0, slope=0.0, seed=99)[rows, rows])
    taught = learn_surrounded(LAMP, grid, frames[::3], first)
    found = [own[LAMP.name] for own in SurroundedLampReader(LAMP, grid, taught).read(np.stack(frames), np.zeros(40))]
    told = [reading.angle_deg == own for reading, own in zip(found, lit, strict=True) if reading.is_seen]

    assert all(told)
    assert sum(not own.is_seen for own in np.array(found)[~lit]) == 0
    assert taught.is_inside == (not taught.near.others)
