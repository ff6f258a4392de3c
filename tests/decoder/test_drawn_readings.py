"""Drawn readings: they lie where the needles are in the frame."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from decoder.alignment import IDENTITY, Alignment
from decoder.drawn_readings import ReadingPlaces, value_text
from decoder.flight_data import FlightData, FlightDataBuilder
from decoder.gaps import fill_gaps
from decoder.panel import Panel
from decoder.panel_pictures import PanelPictures
from decoder.panel_reader import FrameReadings, PanelReader
from decoder.reading import Reading, Status

Draw = Callable[..., NDArray[np.uint8]]
SPEED_CENTRE = np.array([85.4, 110.7])
SHIFT, ROLL_DEG = (3.3, -2.2), 1.2


def rolled(point: tuple[float, float]) -> NDArray[np.float64]:
    """Where the drawing's camera has a point of the panel."""
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


def test_needle_lies_on_the_drawn_needle(draw: Draw, reader: PanelReader) -> None:
    """In a frame that is shifted and rolled, bottom and tip of each needle are where the drawing has them."""
    truth = {"speed_kt": 300.0, "al_lb": 170.0, "fr_lb": 290.0}
    frame = draw(truth, shift_px=SHIFT, roll_deg=ROLL_DEG, noise=1.0, seed=3)
    builder = FlightDataBuilder(reader.source.panel)
    builder.add(0, 0, reader.read(frame))
    data = builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))

    gauges = ReadingPlaces(reader.source, data).frame(0)

    drawn = {reading.name: reading for gauge in gauges for reading in gauge.readings}
    centres = {"speed_kt": SPEED_CENTRE, "al_lb": np.array([235.6, 108.3]), "fr_lb": np.array([235.6, 108.3])}
    for name, angle_deg in truth.items():
        line = drawn[name].line_px
        assert line is not None
        for point, radius_px in zip(line, (20.0, 52.0), strict=True):
            assert np.hypot(*(rolled(on_dial(centres[name], angle_deg, radius_px)) - point)) < 0.5


def test_needle_is_drawn_on_a_dial_that_moved_by_itself(reader: PanelReader, reading: Callable[..., Reading]) -> None:
    """Where dials were found one by one each is drawn at its own place, in lost frames too, which have none."""
    found = {"speed_kt": reading(214.0), "al_lb": reading(200.0), "fr_lb": reading(330.0)}
    builder = FlightDataBuilder(reader.source.panel)
    builder.add_missing(0, 0, "knob not found")
    for frame, shift in ((1, (0.0, 0.0)), (2, (4.5, -3.0))):
        builder.add(frame, frame, FrameReadings(IDENTITY, found, (0.1, 0.1), (shift, (0.0, 0.0))))
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


def test_rim_is_the_outer_perimeter(draw: Draw, reader: PanelReader) -> None:
    """All points of the rim are as far from the pivot as the gauge's outer radius, and surround it."""
    data = built(
        reader.source.panel, reader.read(draw({"speed_kt": 200.0})).readings, Alignment.pinned((0, 0), (5, 7), 3.0, 1.0)
    )

    (speed, _) = ReadingPlaces(reader.source, data).frame(0)

    assert [math.dist(speed.pivot_px, point) for point in speed.rim_px] == pytest.approx([52.0] * 60, abs=1e-3)
    left, top, right, bottom = speed.box_px
    assert ((left + right) / 2, (top + bottom) / 2) == pytest.approx(speed.pivot_px, abs=1e-2)
    assert speed.radius_px == pytest.approx(52.0, abs=1e-3)


def test_moved_pivot_moves_needle_and_rim(
    reading: Callable[..., Reading],
    fly: Callable[..., FlightData],
    source_of: Callable[..., PanelPictures],
    document: dict[str, Any],
) -> None:
    """Where the decoder found the pivot elsewhere, the needle is drawn around that."""
    data = fly([{"speed_kt": reading(270.0)}])
    moved = replace(data, moved_pivots_px={"speed": (2.0, -1.0)})
    panel = source_of(document)

    (before, _), (after, _) = (ReadingPlaces(panel, each).frame(0) for each in (data, moved))

    assert np.subtract(after.pivot_px, before.pivot_px) == pytest.approx([2.0, -1.0])
    assert np.subtract(after.readings[0].line_px, before.readings[0].line_px) == pytest.approx(
        np.array([[2.0, -1.0]] * 2), abs=1e-4
    )


def test_missing_value_has_no_needle(
    reading: Callable[..., Reading],
    fly: Callable[..., FlightData],
    source_of: Callable[..., PanelPictures],
    document: dict[str, Any],
) -> None:
    """A needle that could not be read is named `missing` and not drawn; the others are."""
    data = fly([{"speed_kt": reading(270.0, Status.MISSING, 0.4)}])

    (speed, fuel) = ReadingPlaces(source_of(document), data).frame(0)

    assert (speed.readings[0].text, speed.readings[0].line_px) == ("missing", None)
    assert all(each.line_px is not None for each in fuel.readings)


def test_frame_without_panel_has_no_gauges(
    fly: Callable[..., FlightData], source_of: Callable[..., PanelPictures], document: dict[str, Any]
) -> None:
    """Where the panel was not found there is nothing to draw on."""
    data = fly(["knob not found", {}])
    places = ReadingPlaces(source_of(document), data)

    assert places.frame(0) == ()
    assert len(places.frame(1)) == 2


def test_combined_value_has_a_label_but_no_needle(
    reading: Callable[..., Reading], source_of: Callable[..., PanelPictures], document: dict[str, Any]
) -> None:
    """What several pointers show together is written beside their gauge."""
    content = copy.deepcopy(document)
    gauge = content["gauges"][1]
    gauge |= {"sweep": [0, 360], "unit": "ft", "scale": [[0, 0], [360, 1000]], "wraps": 1000}
    gauge["needles"][1] |= {"scale": [[0, 0], [360, 10000]], "wraps": 10000}
    gauge["combined"] = {"name": "altitude_ft", "needles": ["al_lb", "fr_lb"]}
    panel = source_of(content)
    readings = {"speed_kt": reading(200.0), "al_lb": reading(180.0), "fr_lb": reading(90.0)}
    data = fill_gaps(built(panel.panel, readings, Alignment.pinned((0, 0), (0, 0), 0.0, 1.0)))

    (_, altimeter) = ReadingPlaces(panel, data).frame(0)

    assert [each.name for each in altimeter.readings] == ["al_lb", "fr_lb", "altitude_ft"]
    assert altimeter.readings[2].line_px is None
    assert altimeter.readings[2].text == "2500 ft"


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(93.4149, "%", "93.41 %"), (12.0, "", "12.00"), (math.nan, "kt", "missing")]
)
def test_value_is_written_with_its_unit(value: float, unit: str, text: str) -> None:
    """A value has its unit beside it, if it has one; no value is a word."""
    assert value_text(value, 2, unit) == text


def test_needle_of_an_oblique_dial_follows_its_rim(
    reading: Callable[..., Reading], source_of: Callable[..., PanelPictures], document: dict[str, Any]
) -> None:
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
