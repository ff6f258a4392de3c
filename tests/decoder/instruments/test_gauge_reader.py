"""Reading gauges: needles drawn from formulas are read where they were drawn, or not at all."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Reading, Status
from decoder.panel.errors import PanelError, PictureError
from decoder.panel.vocabulary import Method
from tests.decoder.cockpit import PANEL_ANGLES_DEG, draw, reader_of

COVER_DEG = 270.3
# A panel drawn on a picture is good to a tenth of a pixel: so much all readings of a dial may be off together.
SYSTEMATIC_DEG = 0.16


def speed(reader: PanelReader, frame: GreyPicture) -> Reading:
    """What the speed needle shows."""
    return read_picture(reader, frame).readings["speed_kt"]


def hands(speed_deg: float = 214.0, al_deg: float = 160.0, fr_deg: float = 300.0) -> dict[str, float]:
    """All needles, from the lowest to the uppermost."""
    return {"speed_kt": speed_deg, "al_lb": al_deg, "fr_lb": fr_deg}


@pytest.fixture(scope="module", params=list(Method))
def either(request: pytest.FixtureRequest) -> PanelReader:
    """A reader by each of the methods."""
    return reader_of(method=request.param)


@pytest.mark.parametrize("seed", range(12))
def test_needle_is_read_where_it_was_drawn(either: PanelReader, seed: int) -> None:
    """At any angle of the sweep each needle is read to a twentieth of a degree, by either method."""
    rng = np.random.default_rng(100 + seed)
    angles = hands(rng.uniform(120, 420), rng.uniform(120, 250), rng.uniform(290, 420))
    readings = read_picture(either, draw(angles)).readings

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
    reader: PanelReader, angle_deg: float, light: tuple[float, float], shift: tuple[float, float], roll_deg: float
) -> None:
    """Gain, offset, shift and roll of the frame change the reading by less than a fifth of a pixel at the rim."""
    frame = draw(hands(angle_deg), gain=light[0], offset=light[1], shift_px=shift, roll_deg=roll_deg)
    reading = speed(reader, frame)

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.22)


@pytest.mark.parametrize("angle_deg", [117.0, 118.5, 421.5, 423.0])
def test_needle_a_little_beyond_the_last_tick_is_read(reader: PanelReader, angle_deg: float) -> None:
    """A needle up to four degrees beyond either end of the sweep is read there, not at the end."""
    reading = speed(reader, draw(hands(angle_deg)))

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.05)


@pytest.mark.parametrize("angle_deg", [70.0, 95.0, 100.0, 105.0, 110.0, 430.0, 437.0, 445.0])
def test_needle_outside_the_sweep_is_missing(reader: PanelReader, angle_deg: float) -> None:
    """A needle that points where the scale has nothing is not pulled to the scale's end."""
    reading = speed(reader, draw(hands(angle_deg)))

    assert reading.status is Status.MISSING


SPOILT: dict[str, Callable[[GreyPicture], object]] = {
    "black": lambda dial: dial.fill(0),
    "as dark as a dial": lambda dial: dial.fill(40),
    "white": lambda dial: dial.fill(255),
    "noise": lambda dial: np.copyto(dial, np.random.default_rng(61).integers(0, 255, dial.shape).astype(np.uint8)),
    "in negative": lambda dial: np.copyto(dial, draw(hands(250.0), levels={"speed_kt": 0.0})[50:175, 25:140]),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_dial_without_its_needle_has_no_reading(reader: PanelReader, spoil: Callable[[GreyPicture], object]) -> None:
    """Nothing on it, noise, or a needle dark where it should be light: nothing is taken for the needle."""
    frame = draw(hands())
    spoil(frame[50:175, 25:140])

    assert speed(reader, frame).status is Status.MISSING


@pytest.mark.parametrize("shift_x", [-40.0, -60.0, -75.0])
@pytest.mark.parametrize("angle_deg", [150.0, 180.0, 210.0, 290.0, 360.0])
@pytest.mark.parametrize("dials_move", [False, True], ids=["with the panel", "each by itself"])
def test_dial_partly_outside_the_frame_is_not_guessed(
    reader: PanelReader, shift_x: float, angle_deg: float, *, dials_move: bool
) -> None:
    """Where part of a dial lies outside the frame its needle is read where it is, or is missing."""
    placed = reader.with_placement(replace(reader.placement, dials_move=dials_move))
    try:
        reading = speed(placed, draw(hands(angle_deg), shift_px=(shift_x, 0.0)))
    except PictureError:
        return

    assert reading.status is Status.MISSING or reading.angle_deg == pytest.approx(angle_deg, abs=0.5)
    if angle_deg == 360.0 and shift_x > -75.0:  # half of the dial shows, and the needle on it
        assert reading.status is Status.READ


def test_gauges_do_not_disturb_each_other(reader: PanelReader) -> None:
    """Nothing that happens on one dial changes what another shows."""
    plain = draw(hands(250.0))
    spoilt = plain.copy()
    spoilt[60:170, 184:294] = 255

    assert speed(reader, spoilt) == speed(reader, plain)
    assert read_picture(reader, spoilt).readings["fr_lb"].status is Status.MISSING


LEVELS = {"alike": {}, "dim covered": {"al_lb": 150.0}, "dim cover": {"fr_lb": 150.0}}
# A covering needle dimmer than the one below it, as no instrument has it, may be lost beside that:
# docs/adr/0004-kinds-of-instrument.md.
CLEAR = ("alike", "dim covered")


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

    @property
    def valued(self) -> list[tuple[Reading, float]]:
        """The readings that have a value, and how far off they are."""
        both = zip((self.lower, self.upper), self.errors_deg, strict=True)
        return [(reading, error) for reading, error in both if reading.status is not Status.MISSING]

    @property
    def shows(self) -> bool:
        """Whether the covered needle, or an edge of it, was read."""
        return self.lower.status in (Status.EDGE, Status.READ)


@functools.cache
def pairs_of(kind: str) -> list[Pair]:
    """The covered needle at every degree from thirty before the covering one to thirty after it."""
    levels = LEVELS[kind]
    reader = reader_of(panel=draw(PANEL_ANGLES_DEG, levels=levels))
    found = []
    for apart_deg in np.arange(-30.0, 31.0):
        readings = read_picture(reader, draw(hands(214.0, COVER_DEG + apart_deg, COVER_DEG), levels=levels)).readings
        found.append(Pair(float(apart_deg), readings["al_lb"], readings["fr_lb"]))
    return found


Wrong = Callable[[Pair], object]
NEVER: dict[str, tuple[Iterable[str], Wrong]] = {
    "the needle above is not read, though nothing lies over it": (
        CLEAR,
        lambda pair: (
            pair.upper.status is not Status.READ or abs(pair.errors_deg[1]) > max(0.5, 3 * pair.upper.sigma_deg)
        ),
    ),
    "a needle that shows is missing": (CLEAR, lambda pair: pair.lower.status is Status.MISSING),
    "an edge is off by more than half a degree": (
        LEVELS,
        lambda pair: pair.lower.status is Status.EDGE and abs(pair.errors_deg[0]) > 0.5,
    ),
    "a whole needle is off by more than a tenth of a degree": (
        CLEAR,
        lambda pair: pair.lower.status is Status.READ and abs(pair.errors_deg[0]) > 0.1,
    ),
    "an edge of the cover is taken for the needle below": (
        CLEAR,
        lambda pair: (
            pair.shows
            and abs(pair.apart_deg) >= 1.0
            and (pair.lower.angle_deg - pair.upper.angle_deg) * pair.apart_deg <= 0
        ),
    ),
    "a hidden needle is elsewhere than its cover, surer than that, or one that shows": (
        LEVELS,
        lambda pair: (
            pair.lower.status is Status.HIDDEN
            and (
                pair.lower.angle_deg != pair.upper.angle_deg
                or pair.lower.sigma_deg < pair.upper.sigma_deg
                or abs(pair.apart_deg) > 4.0
            )
        ),
    ),
    "a reading is sure and wrong": (
        LEVELS,
        lambda pair: any(abs(off) > 4 * np.hypot(each.sigma_deg, SYSTEMATIC_DEG) for each, off in pair.valued),
    ),
    "a reading says that it is exact, to less than a thousandth of a degree": (
        LEVELS,
        lambda pair: not all(0.001 < each.sigma_deg < np.inf for each, _ in pair.valued),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "wrong"),
    [pytest.param(kind, wrong, id=f"{kind}: {what}") for what, (kinds, wrong) in NEVER.items() for kind in kinds],
)
def test_what_never_is_read_of_two_needles(kind: str, wrong: Wrong) -> None:
    """However far apart they are, and whichever is the brighter."""
    assert [pair for pair in pairs_of(kind) if wrong(pair)] == []


@pytest.mark.parametrize("kind", CLEAR)
def test_statuses_come_in_order(kind: str) -> None:
    """From under its cover outwards a needle is hidden, then an edge of it shows, then it is read whole."""
    pairs, order = pairs_of(kind), [Status.HIDDEN, Status.EDGE, Status.READ]
    for side in (pairs[30::-1], pairs[30:]):
        seen = [pair.lower.status for pair in side]
        assert seen == sorted(seen, key=order.index)
        assert set(seen) == set(order)


@pytest.mark.parametrize("cover_deg", [140.0, 233.3, 300.0, 411.7])
def test_covering_needle_alone_shows_no_other(reader: PanelReader, cover_deg: float) -> None:
    """With no other needle on the dial, the covering one's own edges are not taken for it."""
    readings = read_picture(reader, draw({"fr_lb": cover_deg})).readings

    assert readings["al_lb"].status in (Status.HIDDEN, Status.MISSING)
    assert readings["fr_lb"].angle_deg == pytest.approx(cover_deg, abs=0.1)


def test_glare_across_both_needles_hides_none(reader: PanelReader) -> None:
    """Where the covering needle is not seen clearly the other is not said to lie under it."""
    frame = draw({"al_lb": 200.0, "fr_lb": 300.0})
    glare = np.zeros(frame.shape, np.uint8)
    cv2.ellipse(glare, (236, 95), (60, 45), 0.0, 0.0, 360.0, 220, -1)
    readings = read_picture(reader, cv2.add(frame, cv2.GaussianBlur(glare, (0, 0), 6))).readings

    assert readings["al_lb"].status is Status.MISSING


@pytest.mark.parametrize("seed", range(4))
def test_noise_does_not_make_an_edge(reader: PanelReader, seed: int) -> None:
    """Under its cover a needle stays hidden when the frame is noisy; no edge is read out of the noise."""
    readings = read_picture(reader, draw({"al_lb": 300.0, "fr_lb": 300.0}, noise=5.0, seed=seed)).readings

    assert readings["al_lb"].status is Status.HIDDEN
    assert readings["fr_lb"].angle_deg == pytest.approx(300.0, abs=0.4)


def test_glare_over_the_covered_needle_does_not_hide_it_under_the_other(reader: PanelReader) -> None:
    """With its own place overexposed and the cover in sight, the needle has no value that is sure and wrong."""
    frame = draw(hands(214.0, 160.0, 300.0)).astype(np.float64)
    y, x = np.mgrid[0 : frame.shape[0], 0 : frame.shape[1]]
    glare = 400 * np.exp(-((x - 202) ** 2 + (y - 120) ** 2) / 500)
    readings = read_picture(reader, np.clip(frame + glare, 0, 255).astype(np.uint8)).readings

    assert readings["fr_lb"].angle_deg == pytest.approx(300.0, abs=0.1)
    assert readings["al_lb"].status in (Status.HIDDEN, Status.MISSING) or readings["al_lb"].angle_deg == pytest.approx(
        160.0, abs=0.5
    )


def test_covered_needle_is_read_when_its_cover_is_lost(reader: PanelReader) -> None:
    """Without the covering needle on the dial the other is read on its own."""
    frame = draw({"speed_kt": 214.0, "al_lb": 250.0})
    readings = read_picture(reader, frame).readings

    assert readings["al_lb"].status is Status.READ
    assert readings["al_lb"].angle_deg == pytest.approx(250.0, abs=0.1)
    assert readings["fr_lb"].status is Status.MISSING


def template(content: dict[str, Any], gauge: int, **template: object) -> None:
    """Cuts the first needle of a gauge elsewhere."""
    content["gauges"][gauge]["needles"][0]["template"] = template


def outside_the_sweep(content: dict[str, Any]) -> None:
    """A template is cut far from where the needle can point."""
    content["gauges"][0]["sweep"] = [120, 200]
    template(content, 0, at=300.0, span=18)


NO_NEEDLE = r"gauges\[1\]\.needles\[0\]\.template: .*shows no needle there"
OUTSIDE = r"gauges\[0\](\.needles\[0\]\.template)?: lies outside the 360 x 220 picture"
UNFIT: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "size": (
        lambda content: template(content, 1, at=200.0, span=18, picture="other.png"),
        r"gauges\[1\]\.needles\[0\]\.template\.picture: .*panel picture's size",
    ),
    "below": (lambda content: template(content, 1, at=80.0, span=18), NO_NEEDLE),
    "beside": (lambda content: template(content, 1, at=20.0, span=18), NO_NEEDLE),
    "flat": (lambda content: template(content, 1, picture="flat.png"), NO_NEEDLE),
    "sweep": (outside_the_sweep, r"gauges\[0\]\.needles\[0\]\.template\.at: 300 degrees lies outside"),
    "left": (lambda content: content["gauges"][0].update(centre=[20, 110]), OUTSIDE),
    "top": (lambda content: content["gauges"][0].update(centre=[85, 10]), OUTSIDE),
    "right": (lambda content: content["gauges"][0].update(centre=[370, 110]), OUTSIDE),
    "huge": (
        lambda content: content["gauges"].append(
            {"name": "lamp", "window": [[0, 0], [3000, 0], [3000, 3000], [0, 3000]], "lamp": {"name": "lit"}}
        ),
        r"gauges\[2\]\.window: covers 36.0 million pixels",
    ),
}


@pytest.mark.parametrize(("change", "says"), UNFIT.values(), ids=UNFIT)
def test_panel_that_does_not_fit_its_picture_is_refused(change: Callable[[dict[str, Any]], object], says: str) -> None:
    """A template without a needle, or a gauge beyond the picture, is named with its path before anything is read."""
    with pytest.raises(PanelError, match=says):
        reader_of(change, other=np.zeros((100, 100), np.uint8), flat=np.full((17, 33), 90, np.uint8))
