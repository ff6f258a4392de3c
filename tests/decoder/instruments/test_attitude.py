"""Attitude indicators: bank and pitch as drawn, whatever fixed marks are over the horizon; missing if it is hidden."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import FramePicture, GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.imaging.unwrapping import PolarGrid, gauge_grid
from decoder.instruments.kinds.dials.attitude import (
    AttitudeKind,
    AttitudeReader,
    first_attitude,
    learn_attitude,
)
from decoder.instruments.kinds.dials.horizon import Attitudes
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import FrameReadings, Status
from decoder.learning.fit import fit_to_flight, squared_up, tune
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.kinds.attitude import Attitude
from decoder.panel.scale import Scale
from tests.decoder.instruments.dials import CENTRE, SCALE, Canvas, apart, paint, reader_for

A_DEGREE_PX = 2.0
WINDOW_PX, RING_PX, RIM_PX = 50.0, 54.0, 70.0
PANEL_ROLL_DEG, PANEL_PITCH_DEG = 12.0, 4.0
SKY, GROUND, WHITE, BEZEL = 150.0, 60.0, 225.0, 35.0
UP_PX = [(deg - PANEL_PITCH_DEG) * A_DEGREE_PX for deg in (-10, 0, 10)]


def described(*, ring: bool) -> dict[str, Any]:
    """The gauge as a person describes it on the picture at `PANEL_ROLL_DEG` and `PANEL_PITCH_DEG`."""
    attitude: dict[str, Any] = {
        "roll": "roll_deg",
        "pitch": "pitch_deg",
        "window": WINDOW_PX - 1,
        "ladder": [[up_px, deg] for up_px, deg in zip(UP_PX, (-10, 0, 10), strict=True)],
    }
    if ring:
        attitude["ring"] = RING_PX
    return {
        "name": "attitude",
        "radius": [4, RIM_PX],
        "sweep": [0, 360],
        "unit": "deg",
        "scale": [[270 - PANEL_ROLL_DEG, 0], [450 - PANEL_ROLL_DEG, 180]],
        "wraps": 360,
        "attitude": attitude,
    }


def _box() -> tuple[slice, slice]:
    """Where the dial lies on a canvas."""
    reach = math.ceil((RIM_PX + 5) * SCALE)
    left, top = (round((at + 0.5) * SCALE) for at in CENTRE)
    return slice(top - reach, top + reach), slice(left - reach, left + reach)


@cache
def _around_centre() -> tuple[Floats, Floats]:
    """Returns x and y of the canvas there, in pixels around the centre."""
    y, x = np.mgrid[_box()].astype(np.float32)
    return (x + 0.5) / SCALE - 0.5 - CENTRE[0], (y + 0.5) / SCALE - 0.5 - CENTRE[1]


@cache
def _parts_of_dial() -> tuple[Mask, Mask, Mask]:
    """Returns what lies in the window, on the ring, and on the dial."""
    radius = np.hypot(*_around_centre())
    return radius < WINDOW_PX, (radius > RING_PX + 2) & (radius < RIM_PX - 2), radius < RIM_PX + 4


@cache
def _still_marks() -> list[tuple[Mask, float]]:
    """Returns where the symbol, its post and the index are, and their levels."""
    (x, y), (seen, _, _) = _around_centre(), _parts_of_dial()
    symbol = (np.abs(y) < 1.5) & (np.abs(x) > 8) & (np.abs(x) < 30) | (np.hypot(x, y) < 2.5)
    index = (np.abs(x) < 2) & (y < -RING_PX) & (y > -RIM_PX - 4)
    return [(symbol, 240.0), ((np.abs(x) < 5) & (y > 30) & seen, 20.0), (index, 110.0)]


def draw(
    roll_deg: float,
    pitch_deg: float,
    seed: int = 0,
    *,
    ring: bool = True,
    plain: bool = False,
    sky: float = SKY,
    gain: float = 1.0,
    hand: float = 0.0,
    turns: tuple[float, float] = (1.0, 1.0),
    glow: tuple[float, float] = (0.0, 0.0),
) -> GreyPicture:
    """Draws one: `plain` has only its line, no sky and ladder; a `hand` covers this part of the dial.

    `turns` are the turns of the horizon, and of the direction of its shift, for one degree of bank. `glow` is by how
    many grey levels the light on its glass rises from the middle to the right and the lower rim of the window.
    """

    def what(canvas: Canvas) -> None:
        (x, y), roll = _around_centre(), math.radians(roll_deg)
        levels = np.full(x.shape, BEZEL, np.float32)
        seen, around, dial = _parts_of_dial()
        turned, way = (turn * roll for turn in turns)
        down_px = pitch_deg * A_DEGREE_PX
        x_off, y_off = x[seen] - down_px * math.sin(way), y[seen] - down_px * math.cos(way)
        its_right = x_off * math.cos(turned) - y_off * math.sin(turned)
        its_up = -x_off * math.sin(turned) - y_off * math.cos(turned)
        levels[seen] = horizon(its_right, its_up / A_DEGREE_PX, plain=plain, sky=sky)
        if ring:
            across, down = x[around], y[around]
            right = across * math.cos(roll) - down * math.sin(roll)
            levels[around] = marks_of_bank(right, -across * math.sin(roll) - down * math.cos(roll))
        for place, level in _still_marks():
            levels[place] = level
        if hand:
            levels[x < RIM_PX * (2 * hand - 1)] = 105.0
        glowing = levels * gain + (x * glow[0] + y * glow[1]) / WINDOW_PX
        canvas.picture[_box()][dial] = glowing.clip(0, 255)[dial]

    return paint(what, seed=seed)


def horizon(right: Floats, pitch_deg: Floats, *, plain: bool, sky: float) -> Floats:
    """Levels of the horizon's picture at places of it: sky, ground, a line between, and a ladder."""
    levels = np.full(pitch_deg.shape, GROUND) if plain else np.where(pitch_deg > 0, sky, GROUND)
    levels[np.abs(pitch_deg) < 0.7] = WHITE
    if not plain:
        mark_deg = np.round(pitch_deg / 5) * 5
        half_px = np.where(mark_deg % 10 == 0, 18.0, 9.0)
        levels[(np.abs(pitch_deg - mark_deg) < 0.35) & (np.abs(right) < half_px) & (np.abs(mark_deg) <= 80)] = WHITE
    return levels


def marks_of_bank(right: Floats, up: Floats) -> Floats:
    """Levels of the ring: marks at 0, 10, 20, 30, 60 and 90 degrees to either side."""
    bank_deg, radius = np.degrees(np.arctan2(right, up)), np.hypot(right, up)
    levels = np.full(right.shape, BEZEL)
    for mark_deg in (-90, -60, -30, -20, -10, 0, 10, 20, 30, 60, 90):
        half_px = 1.0 if abs(mark_deg) in {10, 20} else 2.5 if mark_deg == 0 else 1.6
        levels[np.abs(np.radians(bank_deg - mark_deg)) * radius < half_px] = WHITE  # none is half a turn away
    return levels


def flight(*, ring: bool, sky: float = SKY) -> list[GreyPicture]:
    """Frames of a flight with turns, climbs and descents."""
    rolls = [0, 8, 25, 40, 55, 30, 5, -10, -28, -45, -60, -35, -12, 3, 15, -5]
    pitches = [0, 5, 11, 8, 2, -6, -12, -15, -8, -2, 4, 10, 15, 18, -18, 1]
    return [draw(*both, 100 + index, ring=ring, sky=sky) for index, both in enumerate(zip(rolls, pitches, strict=True))]


@pytest.mark.parametrize(("given", "true_deg"), [({}, 270.0), ({"index": 270.0}, 272.0)])
def test_an_index_that_was_left_out_is_straight_up_wherever_the_ring_turns(
    given: dict[str, float], true_deg: float
) -> None:
    """A clicked mark has another direction from the pivot than from the drawn centre; this one was not clicked."""
    drawn = described(ring=True)
    gauge = Gauge.model_validate({**drawn, "centre": list(CENTRE), "attitude": {**drawn["attitude"], **given}})

    carried = gauge.at_angles(lambda angle_deg: angle_deg + 2.0)

    assert carried.quantities[0].marks[0][0] == pytest.approx(272.0 - PANEL_ROLL_DEG)
    assert carried.attitude is not None
    assert carried.attitude.index == true_deg


SQUEEZE = Squeeze(0.05, -0.07)
ROLLED_DEG = 25.0


def warped(picture: GreyPicture, matrix: Floats) -> GreyPicture:
    """The picture as a (2, 2) matrix makes it appear around the dial's centre."""
    centre = np.array(CENTRE)
    seen = np.column_stack([matrix, centre - matrix @ centre])
    return np.asarray(cv2.warpAffine(picture, seen, picture.shape[::-1], flags=cv2.INTER_CUBIC), np.uint8)


def squeezed(picture: GreyPicture) -> GreyPicture:
    """The dial as seen from some 33 degrees aside."""
    return warped(picture, SQUEEZE.matrix)


def rolled(picture: GreyPicture) -> GreyPicture:
    """The dial as a rolled camera sees it."""
    cos, sin = math.cos(math.radians(ROLLED_DEG)), math.sin(math.radians(ROLLED_DEG))
    return warped(picture, np.array([[cos, -sin], [sin, cos]]))


def seen_at(angle_deg: float) -> tuple[float, float]:
    """Where a point at an angle of the dial appears: its angle there, and how much farther from the centre."""
    x, y = SQUEEZE.matrix @ [math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))]
    return angle_deg + math.remainder(math.degrees(math.atan2(y, x)) - angle_deg, 360.0), math.hypot(x, y)


@pytest.mark.slow
@pytest.mark.parametrize("ring", [True, False], ids=["ring", "no ring"])
def test_an_indicator_that_was_drawn_as_it_appears_from_aside_is_squared_up(*, ring: bool) -> None:
    """As it appears, banks are up to 5 degrees off, and pitch a tenth, and no ring matches that turns."""
    described_ = described(ring=ring)
    described_["scale"] = [[seen_at(angle_deg)[0], bank] for angle_deg, bank in described_["scale"]]
    _, size = seen_at(270 - PANEL_ROLL_DEG)
    described_["attitude"] |= {
        "index": seen_at(270.0)[0],
        "ladder": [[up_px * size, pitch_deg] for up_px, pitch_deg in described_["attitude"]["ladder"]],
    }
    frames = [squeezed(frame) for frame in flight(ring=ring)]
    drawn = reader_for([described_], squeezed(draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=ring)))

    reader = tune(squared_up(drawn, [SQUEEZE]), frames)

    for seed, (roll_deg, pitch_deg) in enumerate([(45.0, 6.0), (-45.0, -8.0), (80.0, 3.0), (5.0, 14.0)]):
        assert_read(reader, squeezed(draw(roll_deg, pitch_deg, 40 + seed, ring=ring)), roll_deg, pitch_deg, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("ring", [True, False], ids=["ring", "no ring"])
def test_an_indicator_in_a_rolled_picture_shifts_along_its_own_upright(*, ring: bool) -> None:
    """Its index is drawn where it appears, and so is the horizon's upright."""
    described_ = described(ring=ring)
    described_["scale"] = [[angle_deg + ROLLED_DEG, bank] for angle_deg, bank in described_["scale"]]
    described_["attitude"] |= {"index": 270.0 + ROLLED_DEG}
    picture = rolled(draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=ring))

    reader = reader_for([described_], picture, [rolled(frame) for frame in flight(ring=ring)])

    for seed, (roll_deg, pitch_deg) in enumerate([(45.0, 6.0), (-45.0, -8.0), (80.0, 3.0), (5.0, 14.0)]):
        assert_read(reader, rolled(draw(roll_deg, pitch_deg, 40 + seed, ring=ring)), roll_deg, pitch_deg, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("off_deg", [-5.0, 4.0])
def test_a_bank_that_was_drawn_wrong_without_a_ring_is_told_by_the_horizon_itself(off_deg: float) -> None:
    """Its line and its ladder show how far it is turned in the panel picture."""
    described_ = described(ring=False)
    described_["scale"] = [[angle_deg + off_deg, bank] for angle_deg, bank in described_["scale"]]

    reader = reader_for([described_], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=False), flight(ring=False))

    for seed, (roll_deg, pitch_deg) in enumerate([(45.0, 6.0), (-45.0, -8.0), (80.0, 3.0), (5.0, 14.0)]):
        assert_read(reader, draw(roll_deg, pitch_deg, 40 + seed, ring=False), roll_deg, pitch_deg, 0.5)
    (told,) = AttitudeKind().findings(reader.source.panel.gauges[0], reader.appearance)
    assert float(told.split()[9]) == pytest.approx(abs(off_deg), abs=0.2)


@pytest.fixture(scope="module", params=[True, False], ids=["ring", "no ring"])
def ring(request: pytest.FixtureRequest) -> bool:
    """Whether a ring of marks turns around the window."""
    return bool(request.param)


@pytest.fixture(scope="module")
def reader(ring: bool) -> PanelReader:  # noqa: FBT001 - a fixture
    """A reader tuned to a flight."""
    return reader_for([described(ring=ring)], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=ring), flight(ring=ring))


def values(reader: PanelReader, read: FrameReadings) -> dict[str, float]:
    """Roll from -180 to 180, and pitch."""
    quantities = reader.source.panel.gauges[0].quantities
    found = {
        each.name: float(Scale.of(each.marks, each.wraps).values_at(np.array([read.readings[each.name].angle_deg]))[0])
        for each in quantities
    }
    return found | {"roll_deg": (found["roll_deg"] + 180) % 360 - 180}


def assert_read(reader: PanelReader, frame: GreyPicture, roll_deg: float, pitch_deg: float, off_deg: float) -> None:
    """Both are read, and right."""
    read = read_picture(reader, frame)
    found = values(reader, read)

    assert {one.status for one in read.readings.values()} == {Status.READ}
    assert abs((found["roll_deg"] - roll_deg + 180) % 360 - 180) < off_deg
    assert abs(found["pitch_deg"] - pitch_deg) < off_deg


@pytest.mark.slow
@settings(max_examples=16, deadline=None)
@given(roll_deg=st.floats(-180, 180), pitch_deg=st.floats(-18, 18), gain=st.sampled_from([0.45, 1.0, 1.1]))
@example(roll_deg=0.0, pitch_deg=0.0, gain=1.0)
@example(roll_deg=-120.0, pitch_deg=15.0, gain=0.45)
@example(roll_deg=180.0, pitch_deg=5.0, gain=1.1)
def test_it_is_read_at_any_bank_and_inverted(
    reader: PanelReader,
    ring: bool,  # noqa: FBT001
    roll_deg: float,
    pitch_deg: float,
    gain: float,
) -> None:
    """Bank and pitch are as drawn, all the way round, wherever the horizon is in sight, in half the light too."""
    assert_read(reader, draw(roll_deg, pitch_deg, 7, ring=ring, gain=gain), roll_deg, pitch_deg, 0.35)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("window_px", "ring_px", "rim_px", "seed"), [(44, 46, 60, 3), (40, 44, 52, 4), (46, 47, 56, 3)]
)
def test_a_ring_that_is_none_is_left_out(window_px: int, ring_px: int, rim_px: int, seed: int) -> None:
    """Where sky and ground move on what was drawn as a ring, bank is read from the horizon alone, and it is said."""
    described_ = described(ring=True) | {"radius": [4, rim_px]}
    described_["attitude"] |= {"window": window_px, "ring": ring_px}
    attitudes = np.random.default_rng(seed).uniform((-60, -14), (60, 14), (28, 2)).tolist()
    frames = [draw(*both, 600 + at, ring=False) for at, both in enumerate(attitudes)]
    reader = reader_for([described_], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=False), frames[:16])

    for frame, (roll_deg, pitch_deg) in zip(frames[16:], attitudes[16:], strict=True):
        assert_read(reader, frame, roll_deg, pitch_deg, 0.35)
    (told,) = AttitudeKind().findings(reader.source.panel.gauges[0], reader.appearance)
    assert told.startswith("bank is read from its horizon alone")


def test_a_ring_that_turns_with_its_horizon_is_no_finding(reader: PanelReader) -> None:
    """It is read, and nothing is said of it; nor where there is none."""
    assert AttitudeKind().findings(reader.source.panel.gauges[0], reader.appearance) == ()


@pytest.mark.slow
def test_bank_is_as_unsure_as_a_reflection_along_the_horizon_makes_it() -> None:
    """No ring tells it from a broad bright band nearly parallel to the horizon: intervals hold, and hide nothing."""
    attitudes = np.random.default_rng(8).uniform((-45, -14), (45, 14), (28, 2)).tolist()
    frames = [draw(*both, 700 + at, ring=False) for at, both in enumerate(attitudes)]
    reader = reader_for([described(ring=False)], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=False), frames[:16])
    x, y = (at - middle for at, middle in zip(np.indices(frames[0].shape)[::-1], CENTRE, strict=True))
    is_inside = []

    for frame, (roll_deg, pitch_deg) in zip(frames[16:], attitudes[16:], strict=True):
        for turned_deg, up_px in ((-20, -15), (-20, 15), (10, -15), (10, 0), (25, 0), (25, 15)):
            way = math.radians(turned_deg - roll_deg)
            off_px = x * math.sin(way) + y * math.cos(way) + up_px - pitch_deg * A_DEGREE_PX
            band = np.where(np.hypot(x, y) < RIM_PX, 70.0 * np.exp(-np.square(off_px / 35.0)), 0.0)
            read = read_picture(reader, (frame + band).clip(0, 255).astype(np.uint8))
            roll = read.readings["roll_deg"]
            if roll.status is Status.READ:
                is_inside.append(apart(values(reader, read)["roll_deg"], roll_deg) <= 1.96 * roll.sigma_deg + 0.05)

    assert len(is_inside) > 60
    assert np.mean(is_inside) >= 0.9


@pytest.mark.slow
def test_light_that_falls_off_across_the_glass_hides_no_horizon() -> None:
    """A sky mirrored in the glass, brighter on another side in each frame, costs no pitch, as long as a ring turns."""
    rng = np.random.default_rng(3)
    glows = [tuple(glow) for glow in rng.uniform(-45, 45, (28, 2)).tolist()]
    attitudes = rng.uniform((-60, -16), (60, 16), (28, 2)).tolist()
    frames = [draw(*both, 500 + at, glow=glow) for at, (both, glow) in enumerate(zip(attitudes, glows, strict=True))]
    reader = reader_for([described(ring=True)], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1), frames[:16])

    for frame, (roll_deg, pitch_deg) in zip(frames[16:], attitudes[16:], strict=True):
        assert_read(reader, frame, roll_deg, pitch_deg, 0.35)


@pytest.mark.parametrize("pitch_deg", [70.0, -70.0])
def test_a_horizon_out_of_sight_is_missing(reader: PanelReader, ring: bool, pitch_deg: float) -> None:  # noqa: FBT001
    """Sky or ground alone gives no pitch; bank is read if a ring shows it."""
    read = read_picture(reader, draw(20.0, pitch_deg, 9, ring=ring))

    assert read.readings["pitch_deg"].status is Status.MISSING
    assert read.readings["roll_deg"].status is (Status.READ if ring else Status.MISSING)


@pytest.mark.parametrize(("part", "roll_deg"), [(0.3, -40.0), (0.5, 0.0), (0.7, 25.0), (1.0, 5.0)])
def test_a_hand_over_it_makes_no_wrong_value(reader: PanelReader, ring: bool, part: float, roll_deg: float) -> None:  # noqa: FBT001
    """Covered in part it is read rightly or not at all, and wholly covered it is missing."""
    read = read_picture(reader, draw(roll_deg, -6.0, 10, ring=ring, hand=part))
    found = values(reader, read)

    for name, truth_deg in (("roll_deg", roll_deg), ("pitch_deg", -6.0)):
        is_right = part < 1.0 and abs(found[name] - truth_deg) < 1.0
        assert is_right or read.readings[name].status is Status.MISSING


@pytest.mark.slow
def test_uncertainties_hold(reader: PanelReader, ring: bool) -> None:  # noqa: FBT001
    """Nearly all values are within two standard uncertainties, as estimated from frames."""
    rng = np.random.default_rng(5)
    rolls, pitches = rng.uniform(-70, 70, 20), rng.uniform(-15, 15, 20)
    off: dict[str, list[float]] = {"roll_deg": [], "pitch_deg": []}
    for index, (roll_deg, pitch_deg) in enumerate(zip(rolls, pitches, strict=True)):
        read = read_picture(reader, draw(roll_deg, pitch_deg, 300 + index, ring=ring))
        found = values(reader, read)
        slope = abs(float(Scale.of(reader.source.panel.gauges[0].quantities[1].marks).slopes_at(np.zeros(1))[0]))
        off["roll_deg"].append((found["roll_deg"] - roll_deg) / math.hypot(read.readings["roll_deg"].sigma_deg, 0.05))
        off["pitch_deg"].append((found["pitch_deg"] - pitch_deg) / (read.readings["pitch_deg"].sigma_deg * slope))

    assert {name: float(np.mean(np.abs(each) < 1.96)) >= 0.9 for name, each in off.items()} == dict.fromkeys(off, True)


@pytest.mark.slow
@pytest.mark.parametrize("sample", ["none", "five", "straight and level"])
def test_little_teaches_nothing_wrong(ring: bool, sample: str) -> None:  # noqa: FBT001
    """Learned from the panel picture alone, five frames, or a flight that hardly moves: it is right, or missing."""
    level = [draw(0.2 * index, 0.1 * index, 70 + index, ring=ring) for index in range(10)]
    taught = {"none": [], "five": flight(ring=ring)[:5], "straight and level": level}[sample]
    reader = reader_for([described(ring=ring)], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=ring), taught)
    rng = np.random.default_rng(6)

    for seed, (roll_deg, pitch_deg) in enumerate(rng.uniform((-180, -20), (180, 20), (6, 2)).tolist()):
        read = read_picture(reader, draw(roll_deg, pitch_deg, 400 + seed, ring=ring))
        found = values(reader, read)
        for name, truth_deg in (("roll_deg", roll_deg), ("pitch_deg", pitch_deg)):
            off_deg = abs((found[name] - truth_deg + 180) % 360 - 180)
            assert read.readings[name].status is Status.MISSING or off_deg < 1.0


@pytest.mark.slow
def test_a_ball_that_looks_the_same_upside_down_tells_no_bank() -> None:
    """A line on a ball with neither sky nor ladder could be either way up: neither is `read`."""
    frames = [
        draw(roll, pitch, 50 + roll, ring=False, plain=True)
        for roll, pitch in zip(range(-40, 41, 5), range(17), strict=True)
    ]
    picture = draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=False, plain=True)
    reader = reader_for([described(ring=False)], picture, frames)

    read = read_picture(reader, draw(10.0, 0.0, 12, ring=False, plain=True))

    assert {one.status for one in read.readings.values()} == {Status.MISSING}


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.1, 0.0])
def test_sky_hardly_brighter_than_the_ground_is_never_taken_for_it(part: float) -> None:
    """A blue sky is no brighter than brown ground: what is the same upside down, or may be where unseen, is missing."""
    sky = GROUND + part * (SKY - GROUND)
    picture = draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, ring=False, sky=sky)
    reader = reader_for([described(ring=False)], picture, flight(ring=False, sky=sky))
    attitudes = np.random.default_rng(6).uniform((-60, -18), (60, 18), (24, 2)).tolist()
    told = 0
    for seed, (roll_deg, pitch_deg) in enumerate(attitudes):
        read = read_picture(reader, draw(roll_deg, pitch_deg, 400 + seed, ring=False, sky=sky))
        if read.readings["roll_deg"].status is not Status.MISSING:
            found = values(reader, read)
            assert apart(found["roll_deg"], roll_deg) < 1.0
            assert abs(found["pitch_deg"] - pitch_deg) < 1.0
            told += 1
    assert told >= 100 * part


def test_the_frames_beside_it_change_nothing(reader: PanelReader, ring: bool) -> None:  # noqa: FBT001
    """One frame is a batch of one."""
    frames = [draw(roll, 3.0, 200 + roll, ring=ring) for roll in (-30, 0, 45)]
    together = reader.read([FramePicture(frame) for frame in frames])

    assert [one.readings for one in together if isinstance(one, FrameReadings)] == [
        read_picture(reader, frame).readings for frame in frames
    ]


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "ends"),
    [
        (90.0, 0.0, ((0.0, 49.0), (0.0, -49.0))),
        (0.0, 10.0, ((-math.sqrt(49**2 - 20**2), 20.0), (math.sqrt(49**2 - 20**2), 20.0))),
        (180.0, 10.0, ((math.sqrt(49**2 - 20**2), -20.0), (-math.sqrt(49**2 - 20**2), -20.0))),
    ],
)
def test_the_horizon_is_drawn_where_it_is(
    roll_deg: float, pitch_deg: float, ends: tuple[tuple[float, float], ...]
) -> None:
    """From its left end to its right one: down when the nose is up; nowhere without a value, or out of sight."""
    gauge = Gauge.model_validate({"centre": CENTRE, **described(ring=True)})
    line = gauge.lines({"roll_deg": roll_deg, "pitch_deg": pitch_deg})["pitch_deg"]

    seen = [(px * math.cos(math.radians(deg)), px * math.sin(math.radians(deg))) for deg, px in line]
    assert np.array(seen) == pytest.approx(np.array(ends), abs=1e-6)
    for roll, pitch in ((math.nan, pitch_deg), (roll_deg, math.nan), (roll_deg, 60.0)):
        assert gauge.lines({"roll_deg": roll, "pitch_deg": pitch}) == {}


def test_the_horizon_is_drawn_where_it_is_in_a_rolled_picture() -> None:
    """Level flight is a line as far off the picture's level as the index is off straight up."""
    turned = described(ring=True)
    turned["scale"] = [[angle_deg + ROLLED_DEG, bank] for angle_deg, bank in turned["scale"]]
    turned["attitude"] |= {"index": 270.0 + ROLLED_DEG}

    line = Gauge.model_validate({"centre": CENTRE, **turned}).lines({"roll_deg": 0.0, "pitch_deg": 0.0})["pitch_deg"]

    assert [deg % 360 for deg, _ in line] == pytest.approx([180.0 + ROLLED_DEG, ROLLED_DEG])


def test_it_is_carried_to_a_picture_of_another_size_and_attitude() -> None:
    """Radii and ladder grow with the dial, and the ladder shifts by the pitch that is read there."""
    gauge = {**described(ring=True), "radius": [8.0, 2 * RIM_PX]}
    arc_px = (4 + RIM_PX) / 2
    read = {"roll_deg": 270.0 - 20.0, "pitch_deg": math.degrees(12.0 / arc_px)}

    scale_turn_deg = Attitude.carry(gauge, 3.0, 2.0, read)

    own = gauge["attitude"]
    assert (own["window"], own["ring"], own["index"]) == (2 * (WINDOW_PX - 1), 2 * RING_PX, 273.0)
    assert scale_turn_deg == pytest.approx(20.0)
    assert [up_px for up_px, _ in own["ladder"]] == pytest.approx([2 * (up_px - 12.0) for up_px in UP_PX])


ODD_TURNS = 1.5, 0.75


@cache
def odd_flight() -> list[GreyPicture]:
    """Frames in which the horizon turns and shifts in its own way; the first is the panel picture."""
    way = np.linspace(0.0, 2.0 * math.pi, 16)
    rolls, pitches = 45.0 * np.sin(1.3 * way + 3.1), 13.0 * np.sin(2.1 * way + 5.7)
    attitudes = zip(rolls.tolist(), pitches.tolist(), strict=True)
    frames = [draw(*both, 500 + seed, turns=ODD_TURNS) for seed, both in enumerate(attitudes)]
    return [draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, turns=ODD_TURNS), *frames]


def described_wrongly() -> dict[str, Any]:
    """An odd gauge by someone who took its shift to turn by half of bank."""
    apart = math.radians((ODD_TURNS[0] - ODD_TURNS[1]) * PANEL_ROLL_DEG)
    level_px = PANEL_PITCH_DEG * A_DEGREE_PX * math.cos(apart)
    gauge = described(ring=True)
    gauge["attitude"] |= {
        "ladder": [[deg * A_DEGREE_PX - level_px, deg] for deg in (-10, 0, 10)],
        "horizon_turn": ODD_TURNS[0],
        "shift_turn": 0.5,
    }
    return gauge


def test_way_of_an_odd_horizons_shift_is_told_by_the_flight() -> None:
    """No print shows it: a panel that states a turn by half of bank is read as well as a right one."""
    panel, *frames = odd_flight()
    reader = reader_for([described_wrongly()], panel, frames)

    assert reader.appearance.pictures["roll_deg"].shift_turn == pytest.approx(ODD_TURNS[1], abs=0.01)
    for roll_deg, pitch_deg in ((38.0, 9.0), (-35.0, -9.0), (0.0, 6.0)):
        read = read_picture(reader, draw(roll_deg, pitch_deg, 600, turns=ODD_TURNS))
        assert read.readings["pitch_deg"].status is Status.READ
        assert values(reader, read)["pitch_deg"] == pytest.approx(pitch_deg, abs=0.1)


@pytest.mark.slow
def test_way_of_an_odd_horizons_shift_is_told_around_the_pivot_where_the_flight_shows_it() -> None:
    """Around a centre that was drawn wrong it is told wrong as well: that does not stay."""
    panel, *frames = odd_flight()
    off_px = 1.0
    gauge = described_wrongly() | {"centre": [CENTRE[0], CENTRE[1] + off_px]}
    fitted = fit_to_flight(reader_for([gauge], panel), lambda _: frames[::2])

    assert fitted.moved_px["attitude"] == pytest.approx((0.0, -off_px), abs=0.1)
    assert fitted.reader.appearance.pictures["roll_deg"].shift_turn == pytest.approx(ODD_TURNS[1], abs=0.01)


def test_way_of_an_odd_horizons_shift_stays_as_drawn_without_bank() -> None:
    """A flight straight ahead does not tell it, whatever explains its noise best."""
    odd = described(ring=True)
    odd["attitude"] |= {"horizon_turn": 1.5, "shift_turn": 0.5}
    frames = [draw(8.0 * math.sin(seed), 5.0 * math.cos(seed), 500 + seed, turns=(1.5, 0.75)) for seed in range(10)]
    reader = reader_for([odd], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1, turns=(1.5, 0.75)), frames)

    assert reader.appearance.pictures["roll_deg"].shift_turn == 0.5


def test_a_window_in_which_nothing_is_a_horizon_ends_no_decode() -> None:
    """Noise over all of the dial, in all frames."""
    rng = np.random.default_rng(3)
    frames = []
    for seed in range(8):
        frame = draw(10.0 * seed - 35.0, 0.0, seed)
        x, y = (round(at) for at in CENTRE)
        reach = round(RIM_PX) + 2
        box = slice(y - reach, y + reach), slice(x - reach, x + reach)
        frame[box] = rng.integers(0, 255, (2 * reach, 2 * reach), np.uint8)
        frames.append(frame)
    reader = reader_for([described(ring=True)], draw(PANEL_ROLL_DEG, PANEL_PITCH_DEG, 1), frames)

    assert {reading.status for reading in read_picture(reader, frames[0]).readings.values()} == {Status.MISSING}


SCREEN_DEG_PX = 10.0


def covered(off_px: Floats, half_px: float) -> Floats:
    """From 0 to 1: how much of a pixel lies within a line."""
    return np.clip(half_px - np.abs(off_px) + 0.5, 0.0, 1.0)


def screen(roll_deg: float, pitch_deg: float, grid: PolarGrid, seed: int) -> Floats:
    """A large dial on a screen: sky hardly brighter than the ground, and lines of a hundredth of its width."""
    x, y = grid.points().astype(np.float64) - 200.0
    roll = math.radians(roll_deg)
    right, up_px = x * math.cos(roll) - y * math.sin(roll), -x * math.sin(roll) - y * math.cos(roll)
    above_px = up_px + pitch_deg * SCREEN_DEG_PX
    levels = 64.0 + 6.0 * (above_px > 0) + 120.0 * covered(above_px, 1.5)
    for deg in range(-40, 41, 5):
        off_px, is_ten = above_px - deg * SCREEN_DEG_PX, deg % 10 == 0
        levels += (deg != 0) * 120.0 * covered(off_px, 1.2) * covered(right, 110.0 if is_ten else 40.0)
        blots = np.random.default_rng(1000 + deg).uniform(0.0, 120.0, 3)
        for place, blot in enumerate(blots.tolist()):
            levels += (deg != 0) * blot * covered(off_px, 6.0) * covered(right - 52.0 - 8.0 * place, 2.5)
    levels = np.where((np.abs(y) < 3.0) & (np.abs(x) < 60.0), 190.0, levels)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, levels.shape)
    return np.asarray(levels + noise, np.float32)


@pytest.mark.slow
def test_thin_lines_on_a_large_dial_are_found_between_the_steps_of_the_search() -> None:
    """Half of the frames had been missing, and one was `read` ten degrees off, where the next line is."""
    ladder = [[deg * SCREEN_DEG_PX, deg] for deg in (-10, -5, 0, 5, 10)]
    attitude = {"roll": "roll_deg", "pitch": "pitch_deg", "window": 150, "ladder": ladder}
    dial = {"name": "screen", "centre": [200, 200], "radius": [4, 150], "sweep": [0, 360], "wraps": 360}
    gauge = Gauge.model_validate({**dial, "scale": [[270, 0], [450, 180]], "attitude": attitude})
    own = Attitudes.of(gauge, gauge_grid(gauge))
    flown = [(23.0 * math.sin(number / 3.0), 7.0 * math.sin(number / 2.3)) for number in range(16)]
    strips = [screen(*both, own.grid, 10 + number) for number, both in enumerate(flown)]
    picture = learn_attitude(own, strips, first_attitude(own, screen(0.0, 0.0, own.grid, 1), None), None)

    shown = np.random.default_rng(4).uniform((-20.0, -7.0), (20.0, 7.0), (40, 2))
    windows = np.stack([screen(*both, own.grid, 90 + number) for number, both in enumerate(shown.tolist())])
    found = [pitch for _, pitch in AttitudeReader(own, picture, None).read(windows)]
    is_read = np.array([one.status is Status.READ for one in found])
    off_deg = (
        Scale.of(own.own.ladder).values_at(np.array([one.angle_deg for one in found]) / own.a_pixel_deg) - shown[:, 1]
    )

    assert is_read.mean() >= 0.9
    assert np.abs(off_deg[is_read]).max() < 0.5


def ball(roll_deg: float, pitch_deg: float, own: Attitudes, seed: int, *, points: bool = False) -> Floats:
    """A dial whose ladder is dense, seen through a window without a ring; a pointer may turn with it at the rim."""
    x, y = (own.grid.points().astype(np.float64) - 200.0) / (own.own.window / 86.0)
    roll = math.radians(roll_deg)
    right, up_px = x * math.cos(roll) - y * math.sin(roll), -x * math.sin(roll) - y * math.cos(roll)
    above_px = up_px + pitch_deg * BALL_DEG_PX
    levels = 60.0 + 90.0 * np.clip(above_px + 0.5, 0.0, 1.0)
    for deg in range(-80, 81, 5):
        is_there = np.abs(above_px - deg * BALL_DEG_PX) < (0.9 if deg else 1.5)
        levels[is_there & (np.abs(right) < ((16.0, 32.0)[deg % 10 == 0] if deg else 200.0))] = 225.0
    if points:
        below_px = 88.0 - up_px
        levels[(below_px > 2.0) & (below_px < 14.0) & (np.abs(right) < below_px / 2)] = 240.0
    levels[(np.abs(y) < 2.0) & (np.abs(x) > 12.0) & (np.abs(x) < 45.0)] = 245.0
    return np.asarray(levels + np.random.default_rng(seed).normal(0.0, 2.0, levels.shape), np.float32)


BALL_DEG_PX = 2.6


def ball_as_drawn(roll_deg: float, pitch_deg: float, size: float = 0.8) -> Attitudes:
    """That dial, drawn at this attitude."""
    ladder = [[size * (deg - pitch_deg) * BALL_DEG_PX, deg] for deg in (-10, 0, 10)]
    attitude = {"roll": "roll_deg", "pitch": "pitch_deg", "window": 86 * size, "ladder": ladder}
    dial = {"name": "ball", "centre": [200, 200], "radius": [6 * size, 104 * size], "sweep": [0, 360], "wraps": 360}
    scale = [[270 - roll_deg, 0], [450 - roll_deg, 180]]
    gauge = Gauge.model_validate({**dial, "scale": scale, "attitude": attitude})
    return Attitudes.of(gauge, gauge_grid(gauge))


def ball_in_flight(own: Attitudes, *, points: bool = False) -> list[Floats]:
    """Frames of it in turns, climbs and descents."""
    parts = np.arange(16) / 16
    rolls = 60.0 * np.sin(6.0 * np.pi * parts) * np.cos(1.4 * np.pi * parts + 0.3)
    pitches = 15.0 * np.sin(4.0 * np.pi * parts + 1.0) * np.cos(np.pi * parts)
    flown = np.transpose([rolls, pitches]).tolist()
    return [ball(*both, own, seed, points=points) for seed, both in enumerate(flown)]


@pytest.mark.slow
def test_a_ladder_that_is_like_itself_a_mark_further_on_is_learned() -> None:
    """The panel picture, with its symbol, matched there about as well, and so nothing had been learned at all."""
    own = ball_as_drawn(20.0, 5.0)
    picture = learn_attitude(own, ball_in_flight(own), first_attitude(own, ball(20.0, 5.0, own, 99), None), None)

    assert picture.is_learned


@pytest.mark.slow
def test_a_horizon_that_matches_upside_down_as_well_at_first_is_learned_upright() -> None:
    """Symbol, frame and a pointer at the rim make it match there until it is known what stands still over it."""
    own = ball_as_drawn(-10.0, 12.0, 0.6)
    first = first_attitude(own, ball(-10.0, 12.0, own, 99, points=True), None)

    picture = learn_attitude(own, ball_in_flight(own, points=True), first, None)

    assert picture.is_learned
