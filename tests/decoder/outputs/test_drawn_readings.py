"""Drawn readings: they lie where the needles are in the frame, in their status's colour, and hide no dial."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from decoder.imaging.alignment import IDENTITY, Alignment
from decoder.instruments.kinds.dials.geared import told_together
from decoder.instruments.panel_reader import PanelReader, read_picture
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.outputs.drawn_readings import STATUS_COLOURS, DrawnGauge, DrawnReading, ReadingPlaces, spread_text
from decoder.outputs.frame_picture import drawn, every, flagged, gauge_view, nearest, whole_view
from decoder.panel.panel import Panel
from decoder.timeseries.flight_data import FlightData, FlightDataBuilder
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.cockpit import draw, fly, reading, source_of

SPEED_CENTRE = np.array([85.4, 110.7])
SHIFT, ROLL_DEG = (3.3, -2.2), 1.2


def rolled(point: tuple[float, float]) -> NDArray[np.float64]:
    """Place of a point of the panel in the drawing's camera."""
    cos, sin = math.cos(math.radians(ROLL_DEG)), math.sin(math.radians(ROLL_DEG))
    x, y = point
    return np.array([cos * x - sin * y + SHIFT[0], sin * x + cos * y + SHIFT[1]])


def on_dial(centre: NDArray[np.float64], angle_deg: float, radius_px: float) -> tuple[float, float]:
    """A point of a dial in the panel picture."""
    x, y = centre + radius_px * np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    return float(x), float(y)


def built(panel: Panel, readings: Mapping[str, Reading], alignment: Alignment) -> FlightData:
    """Flight data of one frame."""
    builder = FlightDataBuilder(panel)
    builder.add(0, 0, FrameReadings(alignment, readings))
    return builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))


def test_needle_lies_on_the_drawn_needle(reader: PanelReader) -> None:
    """In a shifted and rolled frame, bottom and tip of each needle are where they were drawn."""
    truth = {"speed_kt": 300.0, "al_lb": 170.0, "fr_lb": 290.0}
    frame = draw(truth, shift_px=SHIFT, roll_deg=ROLL_DEG, noise=1.0, seed=3)
    builder = FlightDataBuilder(reader.source.panel)
    builder.add(0, 0, read_picture(reader, frame))
    data = builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))

    gauges = ReadingPlaces(reader.source, data).frame(0)

    drawn = {reading.name: reading for gauge in gauges for reading in gauge.readings}
    centres = {"speed_kt": SPEED_CENTRE, "al_lb": np.array([235.6, 108.3]), "fr_lb": np.array([235.6, 108.3])}
    for name, angle_deg in truth.items():
        line = drawn[name].line_px
        assert line is not None
        for point, radius_px in zip(line, (20.0, 52.0), strict=True):
            assert np.hypot(*(rolled(on_dial(centres[name], angle_deg, radius_px)) - point)) < 0.5


def test_needle_is_drawn_on_a_dial_that_moved_by_itself(reader: PanelReader) -> None:
    """Dials found one by one are drawn at their own places; lost frames have none."""
    found = {"speed_kt": reading(214.0), "al_lb": reading(200.0), "fr_lb": reading(330.0)}
    builder = FlightDataBuilder(reader.source.panel)
    builder.add_missing(0, 0, "knob not found")
    for frame, shift in ((1, (0.0, 0.0)), (2, (4.5, -3.0))):
        builder.add(frame, frame, FrameReadings(IDENTITY, found, (shift, (0.0, 0.0))))
    builder.add_missing(3, 3, "knob not found")
    data = builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))
    places = ReadingPlaces(reader.source, data)
    (speed, fuel), (moved_speed, moved_fuel) = places.frame(1), places.frame(2)

    assert places.frame(0) == places.frame(3) == ()
    assert np.subtract(moved_speed.pivot_px, speed.pivot_px) == pytest.approx((4.5, -3.0), abs=1e-4)
    before, after = speed.readings[0].line_px, moved_speed.readings[0].line_px
    assert before is not None
    assert after is not None
    assert np.subtract(after[1], before[1]) == pytest.approx((4.5, -3.0), abs=1e-4)
    assert moved_fuel.pivot_px == fuel.pivot_px


def test_combined_value_has_a_label_but_no_needle(document: dict[str, Any]) -> None:
    """The combined value of several pointers is written beside their gauge."""
    content = copy.deepcopy(document)
    gauge = content["gauges"][1]
    gauge |= {"sweep": [0, 360], "unit": "ft", "scale": [[0, 0], [360, 1000]], "wraps": 1000}
    gauge["needles"][1] |= {"scale": [[0, 0], [360, 10000]], "wraps": 10000}
    gauge["combined"] = {"name": "altitude_ft", "needles": ["al_lb", "fr_lb"]}
    panel = source_of(content)
    readings = {"speed_kt": reading(200.0), "al_lb": reading(180.0), "fr_lb": reading(90.0)}
    readings["altitude_ft"] = told_together(panel.panel.gauges[1], readings)
    data = fill_gaps(built(panel.panel, readings, Alignment.pinned((0, 0), (0, 0), 0.0, 1.0)))

    (_, altimeter) = ReadingPlaces(panel, data).frame(0)

    assert [each.name for each in altimeter.readings] == ["al_lb", "fr_lb", "altitude_ft"]
    assert altimeter.readings[2].line_px is None
    assert altimeter.readings[2].text == "2500 ft"


@pytest.mark.parametrize(
    ("sigma", "decimals", "text"),
    [
        (0.13, 0, "± 0.3"),
        (0.13, 2, "± 0.25"),
        (2e-5, 2, "± 0.00004"),
        (40.0, 0, "± 78"),
        (0.0, 1, "± 0.0"),
        (np.nan, 1, ""),
    ],
)
def test_an_interval_is_not_rounded_to_nothing(sigma: float, decimals: int, text: str) -> None:
    """A clock's 36798 s with a sigma of 0.13 are not certain to the second."""
    assert spread_text(sigma, decimals) == text


def test_needle_of_an_oblique_dial_follows_its_rim(document: dict[str, Any]) -> None:
    """A dial seen from the side is half as wide: its rim is that ellipse, and a needle half way is drawn shorter."""
    x, y = SPEED_CENTRE
    angles = np.radians(np.arange(0, 360, 30))
    document["gauges"][0]["rim"] = [[float(x + 26 * np.cos(a)), float(y + 52 * np.sin(a))] for a in angles]
    source = source_of(document)
    shown = {"speed_kt": reading(270.0), "al_lb": reading(200.0), "fr_lb": reading(300.0)}
    (speed, _) = ReadingPlaces(source, built(source.panel, shown, IDENTITY)).frame(0)

    left, top, right, bottom = speed.box_px
    assert (right - left) / (bottom - top) == pytest.approx(0.5, abs=0.03)
    line = speed.readings[0].line_px
    assert line is not None
    assert line[1] == pytest.approx((x, top), abs=1.0)


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
    """A mark in the status's colour is where the needle points, not opposite; without a value nothing is drawn."""
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
    """The nearest frame to each time, every n-th, and those with anything interpolated, missing or doubtful."""
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
