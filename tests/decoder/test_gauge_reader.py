"""Reading gauges: needles drawn from formulas are read where they were drawn, or not at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.errors import PanelError, PictureError
from decoder.method import Method
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from decoder.reading import Reading, Status
from decoder.scale import Scale

Draw = Callable[..., GreyPicture]
MakeReader = Callable[..., PanelReader]

COVER_DEG = 270.3
# A panel drawn on a picture is good to a tenth of a pixel: so much all readings of a dial may be off together.
SYSTEMATIC_DEG = 0.16
PANEL_HANDS = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}


def speed(reader: PanelReader, frame: GreyPicture) -> Reading:
    """What the speed needle shows."""
    return reader.read(frame).readings["speed_kt"]


def hands(speed_deg: float = 214.0, al_deg: float = 160.0, fr_deg: float = 300.0) -> dict[str, float]:
    """All needles, from the lowest to the uppermost."""
    return {"speed_kt": speed_deg, "al_lb": al_deg, "fr_lb": fr_deg}


@pytest.fixture(scope="module", params=list(Method))
def either(request: pytest.FixtureRequest, reader_of: MakeReader) -> PanelReader:
    """A reader by each of the methods."""
    return reader_of(method=request.param)


@pytest.mark.parametrize("seed", range(12))
def test_needle_is_read_where_it_was_drawn(either: PanelReader, draw: Draw, seed: int) -> None:
    """At any angle of the sweep each needle is read to a twentieth of a degree, by either method."""
    rng = np.random.default_rng(100 + seed)
    angles = hands(rng.uniform(120, 420), rng.uniform(120, 250), rng.uniform(290, 420))
    readings = either.read(draw(angles)).readings

    assert {name: reading.status for name, reading in readings.items()} == dict.fromkeys(angles, Status.READ)
    for name, angle_deg in angles.items():
        assert readings[name].angle_deg == pytest.approx(angle_deg, abs=0.05)
        assert readings[name].score > 0.95


@given(
    angle_deg=st.floats(120.0, 420.0),
    light=st.tuples(st.floats(0.5, 1.1), st.floats(0.0, 20.0)),
    shift=st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0)),
    roll_deg=st.floats(-0.7, 0.7),
)
@settings(max_examples=40)
def test_light_and_camera_do_not_turn_the_needle(
    reader: PanelReader,
    draw: Draw,
    angle_deg: float,
    light: tuple[float, float],
    shift: tuple[float, float],
    roll_deg: float,
) -> None:
    """Gain, offset, shift and roll of the frame change the reading by less than a fifth of a pixel at the rim."""
    frame = draw(hands(angle_deg), gain=light[0], offset=light[1], shift_px=shift, roll_deg=roll_deg)
    reading = speed(reader, frame)

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.22)


@pytest.mark.parametrize("seed", range(6))
def test_noise_hardly_turns_the_needle(reader: PanelReader, draw: Draw, seed: int) -> None:
    """Six grey levels of noise leave the reading within its own uncertainty."""
    angle_deg = np.random.default_rng(seed).uniform(130, 410)
    reading = speed(reader, draw(hands(angle_deg), noise=6.0, seed=seed))

    assert reading.status is Status.READ
    assert abs(reading.angle_deg - angle_deg) < 3 * np.hypot(reading.sigma_deg, SYSTEMATIC_DEG)


@pytest.mark.parametrize("angle_deg", [117.0, 118.5, 421.5, 423.0])
def test_needle_a_little_beyond_the_last_tick_is_read(reader: PanelReader, draw: Draw, angle_deg: float) -> None:
    """A needle up to four degrees beyond either end of the sweep is read there, not at the end."""
    reading = speed(reader, draw(hands(angle_deg)))

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.05)


@pytest.mark.parametrize("angle_deg", [70.0, 95.0, 100.0, 105.0, 110.0, 430.0, 437.0, 445.0])
def test_needle_outside_the_sweep_is_missing(reader: PanelReader, draw: Draw, angle_deg: float) -> None:
    """A needle that points where the scale has nothing is not pulled to the scale's end."""
    reading = speed(reader, draw(hands(angle_deg)))

    assert reading.status is Status.MISSING


@pytest.mark.parametrize("angle_deg", [359.0, 360.0, 361.3, 405.0])
def test_angles_past_a_full_turn_stay_past_it(reader: PanelReader, draw: Draw, angle_deg: float) -> None:
    """On a sweep to 420 degrees a needle at 405 is at 405, not at 45."""
    assert speed(reader, draw(hands(angle_deg))).angle_deg == pytest.approx(angle_deg, abs=0.05)


@pytest.mark.parametrize("value", [40.0, 512.0, 960.0])
def test_anticlockwise_scale_gives_the_drawn_value(
    reader_of: MakeReader, draw: Draw, document: dict[str, Any], value: float
) -> None:
    """A dial whose values grow anticlockwise is read as any other."""
    marks = [(120.0, 1000.0), (200.0, 500.0), (420.0, 0.0)]
    document["gauges"][0]["scale"] = [list(mark) for mark in marks]
    scale = Scale.of(marks)
    angle_deg = float(scale.angles_of(np.array([value]))[0])
    reading = speed(reader_of(lambda content: content.update(document)), draw(hands(angle_deg)))

    assert scale.values_at(np.array([reading.angle_deg]))[0] == pytest.approx(value, abs=0.5)


@pytest.mark.parametrize("grey", [0, 40, 255])
def test_blank_dial_has_no_needle(reader: PanelReader, draw: Draw, grey: int) -> None:
    """A dial without anything on it scores 0 and has no reading."""
    frame = draw(hands())
    frame[50:175, 25:140] = grey
    reading = speed(reader, frame)

    assert reading.status is Status.MISSING
    assert reading.score < 0.3


def test_noise_on_a_dial_is_no_needle(reader: PanelReader, draw: Draw) -> None:
    """A dial of noise has no reading."""
    frame = draw(hands())
    frame[50:175, 25:140] = np.random.default_rng(61).integers(0, 255, (125, 115)).astype(np.uint8)

    assert speed(reader, frame).status is Status.MISSING


def test_dark_needle_is_no_light_one(reader: PanelReader, draw: Draw) -> None:
    """A needle in negative is not the needle of the template."""
    frame = draw(hands(250.0), levels={"speed_kt": 0.0})

    assert speed(reader, frame).status is Status.MISSING


@pytest.mark.parametrize("shift_x", [-40.0, -60.0, -75.0])
@pytest.mark.parametrize("angle_deg", [150.0, 180.0, 210.0, 290.0, 360.0])
def test_dial_partly_outside_the_frame_is_not_guessed(
    reader: PanelReader, draw: Draw, shift_x: float, angle_deg: float
) -> None:
    """Where part of a dial lies outside the frame its needle is read where it is, or is missing."""
    try:
        reading = speed(reader, draw(hands(angle_deg), shift_px=(shift_x, 0.0)))
    except PictureError:
        return

    assert reading.status is Status.MISSING or reading.angle_deg == pytest.approx(angle_deg, abs=0.5)


def test_gauges_do_not_disturb_each_other(reader: PanelReader, draw: Draw) -> None:
    """Nothing that happens on one dial changes what another shows."""
    plain = draw(hands(250.0))
    spoilt = plain.copy()
    spoilt[60:170, 184:294] = 255

    assert speed(reader, spoilt) == speed(reader, plain)
    assert reader.read(spoilt).readings["fr_lb"].status is Status.MISSING


def test_frame_of_another_size_is_refused(reader: PanelReader) -> None:
    """A picture of another size than the panel's is no frame of this panel."""
    with pytest.raises(PictureError, match=r"the picture is 400 x 300, the panel's 360 x 220"):
        reader.read(np.zeros((300, 400), np.uint8))


def test_reading_one_frame_changes_nothing_for_the_next(reader: PanelReader, draw: Draw) -> None:
    """The same frame gives the same readings, whatever was read before."""
    frame = draw(hands(300.0, 280.0, 287.0))
    first = reader.read(frame).readings
    reader.read(draw(hands(130.0, 400.0, 150.0), noise=20.0, seed=1))

    assert reader.read(frame).readings == first


@dataclass(frozen=True)
class Pair:
    """Two needles at a known separation, and what was read."""

    apart_deg: float
    lower: Reading
    upper: Reading

    @property
    def errors_deg(self) -> tuple[float, float]:
        """How far off the covered and the covering needle's readings are."""
        return self.lower.angle_deg - COVER_DEG - self.apart_deg, self.upper.angle_deg - COVER_DEG


# A covering needle dimmer than the one below it, as no instrument has it, may be lost beside that: docs/decisions.md.
DIM_COVER = "dim cover"
LEVELS = {"alike": {}, DIM_COVER: {"fr_lb": 150.0}, "dim covered": {"al_lb": 150.0}}


@pytest.fixture(scope="module", params=list(LEVELS))
def pairs(request: pytest.FixtureRequest, reader_of: MakeReader, draw: Draw) -> list[Pair]:
    """The covered needle at every degree from thirty before the covering one to thirty after it."""
    levels = LEVELS[request.param]
    reader = reader_of(panel=draw(PANEL_HANDS, levels=levels))
    found = []
    for apart_deg in np.arange(-30.0, 31.0):
        readings = reader.read(draw(hands(214.0, COVER_DEG + apart_deg, COVER_DEG), levels=levels)).readings
        found.append(Pair(float(apart_deg), readings["al_lb"], readings["fr_lb"]))
    return found


@pytest.fixture
def clear_pairs(pairs: list[Pair], request: pytest.FixtureRequest) -> list[Pair]:
    """The same where the covering needle is no dimmer than the covered one."""
    if DIM_COVER in request.node.name:
        pytest.skip("a needle dimmer than the one it covers may be lost beside it")
    return pairs


def test_covering_needle_is_read_wherever_the_covered_one_is(clear_pairs: list[Pair]) -> None:
    """Nothing lies over the uppermost needle, so it is always read: to half a degree, or within what it says."""
    wrong = [
        (pair.apart_deg, pair.upper.status.value, round(pair.errors_deg[1], 2))
        for pair in clear_pairs
        if pair.upper.status is not Status.READ or abs(pair.errors_deg[1]) > max(0.5, 3 * pair.upper.sigma_deg)
    ]

    assert wrong == []


def test_statuses_come_in_order(clear_pairs: list[Pair]) -> None:
    """From under its cover outwards a needle is hidden, then an edge of it shows, then it is read whole."""
    order = [Status.HIDDEN, Status.EDGE, Status.READ]
    for side in (clear_pairs[30::-1], clear_pairs[30:]):
        seen = [pair.lower.status for pair in side if pair.lower.status is not Status.MISSING]
        assert seen == sorted(seen, key=order.index)
        assert set(seen) == set(order)


def test_needle_that_shows_is_not_missing(clear_pairs: list[Pair]) -> None:
    """Between hidden and whole there is an edge to read: no separation leaves the needle missing."""
    assert [pair.apart_deg for pair in clear_pairs if pair.lower.status is Status.MISSING] == []


def test_edges_are_read_to_half_a_degree(pairs: list[Pair]) -> None:
    """What shows of a needle beside its cover tells where it is."""
    wrong = [
        (pair.apart_deg, round(pair.errors_deg[0], 2), round(pair.lower.score, 2))
        for pair in pairs
        if pair.lower.status is Status.EDGE and abs(pair.errors_deg[0]) > 0.5
    ]

    assert wrong == []


def test_whole_needles_are_read_to_a_tenth_of_a_degree(clear_pairs: list[Pair]) -> None:
    """A needle with status read is where it was drawn, however near another one is."""
    wrong = [
        (pair.apart_deg, round(pair.errors_deg[0], 2), round(pair.lower.score, 2))
        for pair in clear_pairs
        if pair.lower.status is Status.READ and abs(pair.errors_deg[0]) > 0.1
    ]

    assert wrong == []


def test_covered_needle_lies_on_its_own_side(clear_pairs: list[Pair]) -> None:
    """An edge is never that of the covering needle: before it or behind it as it was drawn."""
    wrong = [
        (pair.apart_deg, round(pair.lower.angle_deg - pair.upper.angle_deg, 2))
        for pair in clear_pairs
        if pair.lower.status in (Status.EDGE, Status.READ)
        and abs(pair.apart_deg) >= 1.0
        and (pair.lower.angle_deg - pair.upper.angle_deg) * pair.apart_deg <= 0
    ]

    assert wrong == []


def test_hidden_needle_takes_its_covers_place(pairs: list[Pair]) -> None:
    """A hidden needle has exactly the covering one's angle, and is no surer than that."""
    hidden = [pair for pair in pairs if pair.lower.status is Status.HIDDEN]

    assert 0.0 in [pair.apart_deg for pair in hidden]
    for pair in hidden:
        assert pair.lower.angle_deg == pair.upper.angle_deg
        assert pair.lower.sigma_deg >= pair.upper.sigma_deg
        assert abs(pair.apart_deg) <= 4.0


def test_no_reading_is_sure_and_wrong(pairs: list[Pair]) -> None:
    """Whatever has a value is within four times what it says it may be off."""
    wrong = [
        (pair.apart_deg, name, reading.status.value, round(error, 2), round(reading.sigma_deg, 3))
        for pair in pairs
        for name, reading, error in zip(("lower", "upper"), (pair.lower, pair.upper), pair.errors_deg, strict=True)
        if reading.status is not Status.MISSING and abs(error) > 4 * np.hypot(reading.sigma_deg, SYSTEMATIC_DEG)
    ]

    assert wrong == []


def test_no_reading_is_without_uncertainty(pairs: list[Pair]) -> None:
    """Nothing that has a value says that it is exact: a thousandth of a degree is finer than any pixel."""
    exact = [
        (pair.apart_deg, reading.status.value, reading.sigma_deg)
        for pair in pairs
        for reading in (pair.lower, pair.upper)
        if reading.status is not Status.MISSING and not 0.001 < reading.sigma_deg < np.inf
    ]

    assert exact == []


def test_glare_over_the_covered_needle_does_not_hide_it_under_the_other(reader: PanelReader, draw: Draw) -> None:
    """With its own place overexposed and the cover in sight, the needle has no value that is sure and wrong."""
    frame = draw(hands(214.0, 160.0, 300.0)).astype(np.float64)
    y, x = np.mgrid[0 : frame.shape[0], 0 : frame.shape[1]]
    glare = 400 * np.exp(-((x - 202) ** 2 + (y - 120) ** 2) / 500)
    readings = reader.read(np.clip(frame + glare, 0, 255).astype(np.uint8)).readings

    assert readings["fr_lb"].angle_deg == pytest.approx(300.0, abs=0.1)
    assert readings["al_lb"].status in (Status.HIDDEN, Status.MISSING) or readings["al_lb"].angle_deg == pytest.approx(
        160.0, abs=0.5
    )


def test_covered_needle_is_read_when_its_cover_is_lost(reader: PanelReader, draw: Draw) -> None:
    """Without the covering needle on the dial the other is read on its own."""
    frame = draw({"speed_kt": 214.0, "al_lb": 250.0})
    readings = reader.read(frame).readings

    assert readings["al_lb"].status is Status.READ
    assert readings["al_lb"].angle_deg == pytest.approx(250.0, abs=0.1)
    assert readings["fr_lb"].status is Status.MISSING


TEMPLATES = [
    (
        {"at": 200.0, "span": 18, "picture": "other.png"},
        "gauges[1].needles[0].template.picture",
        "panel picture's size",
    ),
    ({"at": 80.0, "span": 18}, "gauges[1].needles[0].template", "shows no needle there"),
    ({"at": 20.0, "span": 18}, "gauges[1].needles[0].template", "shows no needle there"),
    ({"picture": "flat.png"}, "gauges[1].needles[0].template", "shows no needle there"),
]


@pytest.mark.parametrize(("template", "path", "problem"), TEMPLATES, ids=["size", "below", "beside", "flat"])
def test_template_that_does_not_fit_is_refused(
    reader_of: MakeReader, template: dict[str, Any], path: str, problem: str
) -> None:
    """A template that shows no needle is named with its path before anything is read."""

    def change(content: dict[str, Any]) -> None:
        content["gauges"][1]["needles"][0]["template"] = template

    with pytest.raises(PanelError) as refused:
        reader_of(change, other=np.zeros((100, 100), np.uint8), flat=np.full((17, 33), 90, np.uint8))

    assert refused.value.path == path
    assert problem in refused.value.problem


def test_template_outside_the_sweep_is_refused(reader_of: MakeReader) -> None:
    """A template cut far from where the needle can point is a mistake in `at`."""

    def change(content: dict[str, Any]) -> None:
        content["gauges"][0]["sweep"] = [120, 200]
        content["gauges"][0]["needles"][0]["template"] = {"at": 300.0, "span": 18}

    with pytest.raises(PanelError, match=r"gauges\[0\]\.needles\[0\]\.template\.at: 300 degrees lies outside"):
        reader_of(change)


@pytest.mark.parametrize("centre", [[20, 110], [85, 10], [340, 110], [900, 900]], ids=str)
def test_gauge_outside_the_picture_is_refused(reader_of: MakeReader, centre: list[float]) -> None:
    """A gauge that reaches beyond the panel picture is named."""
    with pytest.raises(PanelError, match=r"gauges\[0\]: lies outside the 360 x 220 picture"):
        reader_of(lambda content: content["gauges"][0].update(centre=centre))
