"""A flat panel seen obliquely: what most of its dials show tells how each of them is seen."""

from __future__ import annotations

import math
from collections.abc import Mapping

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from decoder.imaging.motion import jacobian
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import Squeeze
from decoder.instruments.panel_reader import read_picture
from decoder.instruments.reading import Status
from decoder.learning.fit import fit_to_flight, reader_from_panel
from decoder.learning.obliqueness import squeeze_shown, squeezes_seen
from decoder.panel.panel import parse_panel
from decoder.panel.scale import Scale
from decoder.panel.vocabulary import Method
from tests.decoder.instruments.dials import apart

SIZE_PX = 720, 480
RADIUS = 60.0
"""Of bezels, in units of the sheet on which the panel is drawn, which is as large as its picture."""
PLACES = [(130.0 + 155.0 * column, 130.0 + 190.0 * row) for row in range(2) for column in range(4)]
FRAMED = 5
"""The dial that shows no circle."""
FINE = 3
ASIDE = (0.45, -0.2)
"""The tangents of the angles from which the camera looks, to the right and down."""
TURNS = [(35.0 * number, 50.0 + 17.0 * number) for number in range(len(PLACES))]
"""By dial: where its needle is in the panel picture, in degrees, and how far it turns from frame to frame."""


def seen_from(slope: tuple[float, float]) -> NDArray[np.float64]:
    """(3, 3): from the sheet to its picture, by a camera with a focal length as long as the picture is wide."""
    normal = np.array([*slope, 1.0]) / math.hypot(*slope, 1.0)
    right = np.cross([0.0, 1.0, 0.0], normal)
    right /= np.linalg.norm(right)
    down = np.cross(normal, right)
    width, height = SIZE_PX
    lens = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    there = np.column_stack([right, down, [0.0, 0.0, 1.1 * width]])
    sheet = np.array([[1.0, 0.0, -width / 2], [0.0, 1.0, -height / 2], [0.0, 0.0, 1.0]])
    return np.asarray(lens @ there @ sheet)


def sheet(needles_deg: Mapping[int, float]) -> NDArray[np.uint8]:
    """The panel seen square on, enlarged: bezels with a few marks, and one dial in a square frame."""
    width, height = SIZE_PX
    picture = np.full((FINE * height, FINE * width), 90, np.uint8)
    texture = np.random.default_rng(7).integers(20, 230, (9, 9)).astype(np.uint8)
    picture[: FINE * 45, : FINE * 45] = cv2.resize(texture, (FINE * 45, FINE * 45), interpolation=cv2.INTER_CUBIC)

    def at(x: float, y: float) -> tuple[int, int]:
        return round(FINE * x), round(FINE * y)

    for number, (x, y) in enumerate(PLACES):
        if number == FRAMED:
            cv2.rectangle(picture, at(x - RADIUS, y - RADIUS), at(x + RADIUS, y + RADIUS), 30, -1)
        else:
            cv2.circle(picture, at(x, y), round(FINE * RADIUS), 200, -1, cv2.LINE_AA)
            cv2.circle(picture, at(x, y), round(FINE * (RADIUS - 8.0)), 30, -1, cv2.LINE_AA)
        for mark_deg in np.arange(0.0, 360.0, 90.0):
            ends = (along(x, y, mark_deg, radius) for radius in (42.0, 49.0))
            cv2.line(picture, *(at(*end) for end in ends), 220, 2 * FINE, cv2.LINE_AA)
        if number in needles_deg:
            cv2.line(picture, at(x, y), at(*along(x, y, needles_deg[number], 38.0)), 240, 3 * FINE, cv2.LINE_AA)
    return picture


def along(x: float, y: float, angle_deg: float, radius: float) -> tuple[float, float]:
    """A point at some radius from another."""
    return x + radius * math.cos(math.radians(angle_deg)), y + radius * math.sin(math.radians(angle_deg))


def photograph(view: NDArray[np.float64], frame: int = 0) -> GreyPicture:
    """What the camera sees of it."""
    needles_deg = {number: at + frame * step for number, (at, step) in enumerate(TURNS)}
    flat = cv2.resize(sheet(needles_deg), SIZE_PX, interpolation=cv2.INTER_AREA)
    seen = cv2.warpPerspective(flat, view, SIZE_PX, flags=cv2.INTER_CUBIC, borderValue=60)
    noisy = seen + np.random.default_rng(frame).normal(0.0, 2.0, seen.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def appears(view: NDArray[np.float64], point: tuple[float, float]) -> NDArray[np.float64]:
    """Where a point of the sheet appears."""
    place = view @ np.array([*point, 1.0])
    return np.asarray(place[:2] / place[2])


def squeezed(view: NDArray[np.float64], point: tuple[float, float]) -> Squeeze:
    """How a small circle appears there."""
    left, sizes, _ = np.linalg.svd(jacobian(view, point))
    matrix = left @ np.diag(2.0 * sizes / sizes.sum()) @ left.T
    return Squeeze(float(matrix[0, 0] - 1.0), float(matrix[0, 1]))


def drawn(
    view: NDArray[np.float64], picture: GreyPicture, dials: list[int], beside_px: tuple[float, float] = (0.6, -0.4)
) -> PanelPictures:
    """Some dials of the panel as somebody draws them where they appear, with two marks each, centres so far beside."""
    gauges = []
    for number in dials:
        (x, y), (needle_deg, _) = PLACES[number], TURNS[number]
        centre = appears(view, (x, y))

        def angle_deg(
            true_deg: float, radius: float, centre: NDArray[np.float64] = centre, x: float = x, y: float = y
        ) -> float:
            right, down = appears(view, along(x, y, true_deg, radius)) - centre
            return true_deg + math.remainder(math.degrees(math.atan2(down, right)) - true_deg, 360.0)

        size = math.sqrt(abs(np.linalg.det(jacobian(view, (x, y)))))
        template = {"at": angle_deg(needle_deg, 30.0) % 360.0, "span": 16}
        gauges.append(
            {
                "name": f"dial {number}",
                "centre": [float(part) for part in centre + np.array(beside_px)],
                "radius": [10.0 * size, 38.0 * size],
                "sweep": [0, 360],
                "scale": [[angle_deg(0.0, 45.0), 0.0], [angle_deg(180.0, 45.0), 50.0]],
                "wraps": 100,
                "needles": [{"name": f"needle_{number}", "template": template}],
            }
        )
    corner = np.rint(appears(view, (9.0, 9.0))).astype(int).tolist()
    anchors = [{"name": "texture", "box": [*corner, 26, 26]}]
    content = {"name": "panel", "picture": "panel.png", "anchors": anchors, "gauges": gauges}
    return PanelPictures(parse_panel(yaml.safe_dump(content)), {"panel.png": picture}, "0" * 64)


@pytest.mark.parametrize("slope", [ASIDE, (-0.3, 0.1)], ids=["from the left", "from the right"])
def test_each_dial_of_a_flat_panel_is_squared_up(slope: tuple[float, float]) -> None:
    """Seven dials show circles; the eighth, which shows a square, is told by them."""
    view = seen_from(slope)

    found, _ = squeezes_seen(drawn(view, photograph(view), list(range(len(PLACES)))))

    for place, own in zip(PLACES, found, strict=True):
        assert own is not None
        assert np.allclose(own.matrix, squeezed(view, place).matrix, atol=0.006)


@pytest.mark.parametrize(("number", "beside_px"), [(0, (4.0, 0.0)), (4, (0.0, -7.0))])
def test_a_centre_beside_the_middle_of_ellipses_hides_no_squeeze(number: int, beside_px: tuple[float, float]) -> None:
    """As a hub is from near by: circles are looked for around other middles, too, and roughly at first."""
    view = seen_from(ASIDE)
    source = drawn(view, photograph(view), [number], beside_px)
    (gauge,) = source.panel.gauges

    found = squeeze_shown(source.picture, source.optics, np.array(gauge.centre), gauge.radius[1])

    assert np.allclose(found.matrix, squeezed(view, PLACES[number]).matrix, atol=0.012)


def test_panel_seen_square_on_stays_as_it_is_drawn() -> None:
    """There is nothing to square up, whatever its square frame looks like."""
    view = seen_from((0.0, 0.0))

    assert not any(
        each for found in squeezes_seen(drawn(view, photograph(view), list(range(len(PLACES))))) for each in found
    )


def test_two_dials_tell_how_obliquely_a_third_may_be_seen() -> None:
    """They are too few to square it up; but they show that they are no circles, and it may be seen like them."""
    view, dials = seen_from(ASIDE), [0, 1, FRAMED]

    (*_, sure), (*_, likely) = squeezes_seen(drawn(view, photograph(view), dials))

    assert sure is None
    assert likely is not None
    assert likely.part == pytest.approx(squeezed(view, PLACES[FRAMED]).part, rel=0.5)


def test_square_frame_alone_tells_nothing() -> None:
    """What looks most circular in it is no circle."""
    view = seen_from(ASIDE)

    assert squeezes_seen(drawn(view, photograph(view), [FRAMED])) == ((None,), (None,))


def test_dial_that_faces_the_camera_is_not_squared_up_like_the_others() -> None:
    """One dial is turned towards the camera; its own circles are believed."""
    view, turned = seen_from(ASIDE), 2
    picture = photograph(view)
    own = jacobian(view, PLACES[turned])
    towards = math.sqrt(abs(np.linalg.det(own))) * np.eye(2)
    middle = appears(view, PLACES[turned])
    facing = np.column_stack([towards, middle - towards @ np.array(PLACES[turned])])
    hole = np.zeros(picture.shape, np.uint8)
    cv2.circle(hole, tuple(np.rint(middle).astype(int).tolist()), round(1.4 * RADIUS * towards[0, 0]), 255, -1)
    flat = cv2.resize(sheet({turned: TURNS[turned][0]}), SIZE_PX, interpolation=cv2.INTER_AREA)
    picture = np.where(hole > 0, cv2.warpAffine(flat, facing, SIZE_PX), picture)

    found, _ = squeezes_seen(drawn(view, picture, list(range(len(PLACES)))))

    for number, (place, each) in enumerate(zip(PLACES, found, strict=True)):
        assert each is not None
        expected = Squeeze(0.0, 0.0) if number == turned else squeezed(view, place)
        assert np.allclose(each.matrix, expected.matrix, atol=0.012)


def test_needle_of_a_dial_without_circles_is_read_between_its_marks() -> None:
    """Three dials show how a fourth is seen: between its two marks, needles would be read 2 % off."""
    view, dials = seen_from(ASIDE), [0, 1, 4, FRAMED]
    frames = [photograph(view, frame) for frame in range(16)]
    reader = reader_from_panel(drawn(view, frames[0], dials), Method.NORMXCORR)

    fitted = fit_to_flight(reader, lambda _: frames)

    gauge = fitted.panel.gauges[dials.index(FRAMED)]
    at_deg, step_deg = TURNS[FRAMED]
    for frame in (20, 23, 25, 28):
        reading = read_picture(fitted.reader, photograph(view, frame)).readings[f"needle_{FRAMED}"]
        (value,) = Scale.of(gauge.scale, 100.0).values_at(np.array([reading.angle_deg]))
        off = apart(float(value), (at_deg + frame * step_deg) / 3.6, 100.0)
        assert reading.status is Status.READ
        assert off < 0.4, (frame, off)
    assert "corrected" in fitted.findings[gauge.name][0]
