"""Frame pictures: what is drawn stands where the reading is, in its status's colour, and hides no dial."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from decoder.drawn_readings import DrawnGauge, DrawnReading
from decoder.flight_data import FlightData
from decoder.frame_choice import every, flagged, nearest
from decoder.frame_picture import as_jpeg, drawn, gauge_view, whole_view
from decoder.reading import Reading, Status
from decoder.status_colours import STATUS_COLOURS

CENTRE, RADIUS_PX = (100.0, 80.0), 40.0


def gauge(status: Status = Status.READ, centre: tuple[float, float] = CENTRE) -> DrawnGauge:
    """A gauge whose needle points to the right."""
    x, y = centre
    angles = np.radians(np.arange(0, 360, 6))
    rim = tuple((float(x + RADIUS_PX * np.cos(a)), float(y + RADIUS_PX * np.sin(a))) for a in angles)
    line = None if status is Status.MISSING else ((x + 10, y), (x + RADIUS_PX, y))
    return DrawnGauge("speed", centre, rim, (DrawnReading("ias_kt", "87.4 kt", "± 0.2", status, 0.99, line),))


def near(image: Image.Image, place: tuple[float, float], colour: tuple[int, int, int]) -> bool:
    """Whether the image has about this colour at a place."""
    pixel = np.array(image.getpixel((round(place[0]), round(place[1]))), float)
    return bool(np.abs(pixel - colour).max() < 60)


@pytest.mark.parametrize("status", [Status.READ, Status.EDGE, Status.HIDDEN, Status.INTERPOLATED])
def test_pointer_stands_outside_the_rim_in_its_colour(status: Status) -> None:
    """Where the needle points, just outside the rim, stands a mark in the status's colour; opposite stands none."""
    picture = np.full((400, 1600, 3), 60, np.uint8)
    image = drawn(picture, whole_view(picture), [gauge(status)], ("frame 0", ""))

    assert near(image, (CENTRE[0] + 1.13 * RADIUS_PX, CENTRE[1]), STATUS_COLOURS[status])
    assert near(image, (CENTRE[0] - 1.13 * RADIUS_PX, CENTRE[1]), (60, 60, 60))


def test_missing_needle_is_not_drawn() -> None:
    """Without a value no needle and no mark is drawn."""
    picture = np.full((400, 1600, 3), 60, np.uint8)
    image = drawn(picture, whole_view(picture), [gauge(Status.MISSING)], ("frame 0", ""))

    assert near(image, (CENTRE[0] + 1.13 * RADIUS_PX, CENTRE[1]), (60, 60, 60))
    assert near(image, (CENTRE[0] + 0.6 * RADIUS_PX, CENTRE[1]), (60, 60, 60))


def test_small_pictures_are_enlarged_and_captioned() -> None:
    """A picture of 640 pixels is drawn three times as large, with a bar below that leaves the picture alone."""
    picture = np.full((480, 640, 3), 60, np.uint8)
    image = drawn(picture, whole_view(picture), [], ("frame 0", "knob not found"))

    assert image.width == 1920
    assert image.height > 1440
    assert np.asarray(image)[:1440].min() == np.asarray(image)[:1440].max() == 60
    assert np.asarray(image)[1440:].max() > 200


def test_labels_do_not_cover_each_others_gauges() -> None:
    """Two gauges one above the other keep their dials free of both labels."""
    picture = np.full((500, 1600, 3), 60, np.uint8)
    one, other = gauge(centre=(300.0, 120.0)), gauge(centre=(300.0, 230.0))
    image = np.asarray(drawn(picture, whole_view(picture), [one, other], ("frame 0", "")))

    for x, y in ((300, 120), (300, 230)):
        dial = image[y - 25 : y + 25, x - 25 : x - 5]
        assert (dial == 60).all()


def test_gauge_view_is_the_gauge_enlarged() -> None:
    """The crop holds the gauge in its middle, large, and never leaves the frame."""
    picture = np.full((400, 1600, 3), 60, np.uint8)
    view = gauge_view(picture, gauge())
    corner = gauge_view(picture, gauge(centre=(5.0, 395.0)))

    x, y = view.place(CENTRE)
    assert (x, y) == pytest.approx((360.0, 360.0), abs=8)
    assert (corner.left, corner.bottom) == (0, 400)
    assert corner.top < corner.bottom
    assert drawn(picture, corner, [gauge(centre=(5.0, 395.0))], ("", "")).width >= 400


def test_jpeg_is_one_and_the_same_each_time() -> None:
    """The same drawing gives the same bytes, a JPEG that others open."""
    picture = np.full((100, 1600, 3), 60, np.uint8)
    image = drawn(picture, whole_view(picture), [gauge(centre=(300.0, 50.0))], ("frame 0", ""))

    assert as_jpeg(image) == as_jpeg(image)
    assert Image.open(io.BytesIO(as_jpeg(image))).size == image.size


def test_frames_are_chosen_by_time_step_or_doubt(
    fly: Callable[..., FlightData], reading: Callable[..., Reading]
) -> None:
    """The nearest frame to each time, every n-th, and those with anything interpolated, missing or hard to believe."""
    frames: list[object] = [{"speed_kt": reading(200.0 + 0.1 * (number % 3))} for number in range(24)]
    frames[9] = {"speed_kt": reading(320.0)}
    frames[17] = {"speed_kt": reading(200.0, Status.MISSING, 0.3)}
    frames[20] = "knob not found"
    data = fly(frames)

    assert nearest(data, [1.2, 0.0, 99.0]).tolist() == [0, 2, 23]
    assert every(data, 10).tolist() == [0, 10, 20]
    assert flagged(data).tolist() == [9, 17, 20]
