"""Frame pictures: what is drawn stands where the reading is, in its status's colour, and hides no dial."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from PIL import Image

from decoder.instruments.reading import Reading, Status
from decoder.outputs.drawn_readings import STATUS_COLOURS, DrawnGauge, DrawnReading
from decoder.outputs.frame_picture import drawn, every, flagged, gauge_view, nearest, whole_view
from tests.decoder.cockpit import fly, reading

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


@pytest.mark.parametrize("status", Status)
def test_pointer_stands_outside_the_rim_in_its_colour(status: Status) -> None:
    """Where the needle points stands a mark in the status's colour, opposite none; without a value nothing is drawn."""
    picture, ground = np.full((400, 1600, 3), 60, np.uint8), (60, 60, 60)
    image = drawn(picture, whole_view(picture), [gauge(status)], ("frame 0", ""))
    (x, y), is_read = CENTRE, status is not Status.MISSING

    assert near(image, (x + 1.13 * RADIUS_PX, y), STATUS_COLOURS[status] if is_read else ground)
    assert near(image, (x + 0.6 * RADIUS_PX, y), ground) != is_read
    assert near(image, (x - 1.13 * RADIUS_PX, y), ground)


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


def test_frames_are_chosen_by_time_step_or_doubt() -> None:
    """The nearest frame to each time, every n-th, and those with anything interpolated, missing or hard to believe."""
    frames: list[Mapping[str, Reading] | str] = [
        {"speed_kt": reading(200.0 + 0.1 * (number % 3))} for number in range(24)
    ]
    frames[9] = {"speed_kt": reading(320.0)}
    frames[17] = {"speed_kt": reading(200.0, Status.MISSING, 0.3)}
    frames[20] = "knob not found"
    data = fly(frames)

    assert nearest(data, [1.2, 0.0, 99.0]).tolist() == [0, 2, 23]
    assert every(data, 10).tolist() == [0, 10, 20]
    assert flagged(data).tolist() == [9, 17, 20]
