"""Reading gauges: needles drawn from formulas are read where they were drawn, or not at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import Reading, Status
from decoder.panel.errors import PanelError, PictureError
from decoder.panel.vocabulary import Method
from tests.decoder.cockpit import draw, reader_of


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


@pytest.mark.parametrize("seed", range(5))
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
@settings(max_examples=20)
def test_light_and_camera_do_not_turn_the_needle(
    reader: PanelReader, angle_deg: float, light: tuple[float, float], shift: tuple[float, float], roll_deg: float
) -> None:
    """Gain, offset, shift and roll of the frame change the reading by less than a fifth of a pixel at the rim."""
    frame = draw(hands(angle_deg), gain=light[0], offset=light[1], shift_px=shift, roll_deg=roll_deg)
    reading = speed(reader, frame)

    assert reading.status is Status.READ
    assert reading.angle_deg == pytest.approx(angle_deg, abs=0.22)


@pytest.mark.parametrize(
    ("angle_deg", "is_read"),
    [(117.0, True), (423.0, True), (70.0, False), (105.0, False), (110.0, False), (430.0, False)],
)
def test_needle_beyond_its_sweep_is_read_for_four_degrees_and_then_missing(
    reader: PanelReader, angle_deg: float, *, is_read: bool
) -> None:
    """It is read where it is; a needle beyond the scale is not pulled to the scale's end."""
    reading = speed(reader, draw(hands(angle_deg)))

    assert reading.status is (Status.READ if is_read else Status.MISSING)
    assert not is_read or reading.angle_deg == pytest.approx(angle_deg, abs=0.05)


SPOILT: dict[str, Callable[[GreyPicture], object]] = {
    "black": lambda dial: dial.fill(0),
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
@pytest.mark.parametrize("angle_deg", [180.0, 360.0])
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


@pytest.mark.parametrize("apart_px", [(), (0.5, 3.0)])
def test_dial_whose_rim_is_not_found_is_read_where_the_anchors_put_it(
    reader: PanelReader, apart_px: tuple[float, ...]
) -> None:
    """If dials are located one by one, and this one and the other are not: to within how far apart they usually are."""
    placed = reader.with_placement(replace(reader.placement, dials_move=True, apart_px=apart_px))
    frame = draw(hands(250.0))
    y, x = np.mgrid[: frame.shape[0], : frame.shape[1]]
    frame[60:170, 184:294] = 255
    frame[np.abs(np.hypot(x - 85.4, y - 110.7) - 72.0) < 20.0] = 128
    reading = speed(placed, frame)

    assert reading.status is (Status.READ if apart_px else Status.MISSING)
    if apart_px:
        assert reading.angle_deg == pytest.approx(250.0, abs=0.5)
        assert reading.sigma_deg == pytest.approx(np.degrees(apart_px[0] / 36.0), abs=0.1)


def test_gauges_do_not_disturb_each_other(reader: PanelReader) -> None:
    """Nothing that happens on one dial changes what another shows."""
    plain = draw(hands(250.0))
    spoilt = plain.copy()
    spoilt[60:170, 184:294] = 255

    assert speed(reader, spoilt) == speed(reader, plain)
    assert read_picture(reader, spoilt).readings["fr_lb"].status is Status.MISSING


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
    "beside": (lambda content: template(content, 1, at=20.0, span=18), NO_NEEDLE),
    "flat": (lambda content: template(content, 1, picture="flat.png"), NO_NEEDLE),
    "sweep": (outside_the_sweep, r"gauges\[0\]\.needles\[0\]\.template\.at: 300 degrees lies outside"),
    "left": (lambda content: content["gauges"][0].update(centre=[20, 110]), OUTSIDE),
    "right": (lambda content: content["gauges"][0].update(centre=[370, 110]), OUTSIDE),
    "huge": (
        lambda content: content["gauges"].append(
            {"name": "lamp", "window": [[0, 0], [3000, 0], [3000, 3000], [0, 3000]], "lamp": {"name": "lit"}}
        ),
        r"gauges\[2\]\.window: covers 144.0 million pixels",
    ),
}


@pytest.mark.parametrize(("change", "says"), UNFIT.values(), ids=UNFIT)
def test_panel_that_does_not_fit_its_picture_is_refused(change: Callable[[dict[str, Any]], object], says: str) -> None:
    """A template without a needle, or a gauge beyond the picture, is named with its path before anything is read."""
    with pytest.raises(PanelError, match=says):
        reader_of(change, other=np.zeros((100, 100), np.uint8), flat=np.full((17, 33), 90, np.uint8))


def test_gauge_that_is_not_located_by_itself_is_as_unsure_as_the_alignment(reader: PanelReader) -> None:
    """Of a window beside dials that are located one by one, only the anchors tell where it is."""
    seen = reader.unwrap(draw(hands()))
    known = seen.alignment.covariance
    assert known is not None
    doubted = replace(seen, alignment=seen.alignment.with_covariance(replace(known, covariance=known.covariance + 1.0)))
    count = len(reader.source.panel.gauges)
    by_itself, left, aligned = reader.read_unwrapped(
        [
            replace(doubted, dial_sigmas_px=(0.01,) * count),
            replace(doubted, dial_sigmas_px=(0.0,) * count),
            doubted,
        ]
    )
    sigmas_deg = [each.readings["speed_kt"].sigma_deg for each in (by_itself, left, aligned)]

    assert sigmas_deg[1] == sigmas_deg[2] > 5 * sigmas_deg[0]
