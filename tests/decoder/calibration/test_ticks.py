"""A ruler's ticks: found to a few hundredths of a pixel, numbered rightly, and missed rather than guessed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from decoder.calibration.profile import Line
from decoder.calibration.ticks import GRADUATIONS_INCHES, find_ticks
from decoder.errors import CalibrationError
from fixtures.calibration.ruler import Scene, picture

MM_PER_INCH = 25.4


def between(scene: Scene, first_mm: float, last_mm: float, across_mm: float) -> Line:
    """A line along the ruler."""
    return Line(scene.pixel(first_mm, across_mm), scene.pixel(last_mm, across_mm))


@pytest.mark.parametrize(
    ("pixels_per_radian", "across_mm", "first_mm", "last_mm", "graduation", "within_px"),
    [
        (1165, 6.0, 5.3, 430, "1 cm", 0.08),  # a centimetre tick is a third of a pixel thin here
        (2500, 28.5, 130, 270, "1/16 inch", 0.04),
        (5000, 1.5, 130, 270, "1 mm", 0.02),
        (11650, 1.5, 145, 255, "1 mm", 0.015),
        (11650, 4.2, 145, 255, "5 mm", 0.015),
        (11650, 28.0, 145, 255, "1/16 inch", 0.015),
    ],
)
def test_ticks_are_where_they_are(
    pixels_per_radian: float, across_mm: float, first_mm: float, last_mm: float, graduation: str, within_px: float
) -> None:
    """Whatever the zoom and the edge of the ruler; the graduation is told, the length need only be roughly right."""
    scene = Scene(pixels_per_radian, turn_deg=2, tilt_deg=2, place_mm=(200, across_mm))
    line = between(scene, first_mm, last_mm, across_mm)
    ticks = find_ticks(picture(scene), line, 1.04 * (last_mm - first_mm) / MM_PER_INCH)
    apart_mm = GRADUATIONS_INCHES[graduation] * MM_PER_INCH
    first = round((first_mm + ticks.along_px[0] / line.length_px * (last_mm - first_mm)) / apart_mm)
    places = [scene.pixel((first + number - ticks.number[0]) * apart_mm, across_mm) for number in ticks.number]
    error = ticks.along_px - [line.foot(place)[0] for place in places]

    assert ticks.graduation == graduation
    assert len(ticks.number) > 0.85 * (last_mm - first_mm) / apart_mm - 1
    assert np.sqrt(np.mean(error**2)) < within_px


def test_ticks_that_are_covered_are_left_out_and_the_others_keep_their_numbers() -> None:
    """A thumb on the ruler."""
    scene = Scene(5000, place_mm=(200, 1.5))
    covered = picture(scene)
    left, right = int(scene.pixel(183.5, 0)[0]), int(scene.pixel(197.5, 0)[0])
    covered[:, left:right] = 150
    ticks = find_ticks(covered, between(scene, 150.5, 249.5, 1.5), 99 / MM_PER_INCH)
    shown_mm = 151 + ticks.number

    error = ticks.points_px[:, 0] - [scene.pixel(place, 1.5)[0] for place in shown_mm]

    assert 14 <= 99 - len(ticks.number) <= 21
    assert np.abs(error).max() < 0.06


def test_bright_ticks_are_ticks() -> None:
    """A black ruler."""
    scene = Scene(5000, place_mm=(200, 1.5))
    ticks = find_ticks(255 - picture(scene), between(scene, 150.5, 249.5, 1.5), 99 / MM_PER_INCH)

    assert len(ticks.number) > 95
    assert ticks.points_px[:, 0] == pytest.approx([scene.pixel(151 + n, 1.5)[0] for n in ticks.number], abs=0.06)


def test_a_line_beside_the_ruler_has_no_ticks() -> None:
    """Nor has one through nothing but noise, or along the numerals."""
    scene = Scene(5000, place_mm=(200, 1.5))
    for across in (-20.0, 14.5):
        with pytest.raises(CalibrationError, match="no ticks are found on the line; draw it"):
            find_ticks(picture(scene), between(scene, 150, 250, across), 100 / MM_PER_INCH)


def test_a_length_that_no_ruler_has_is_refused() -> None:
    """Inches given for a line that is not that long."""
    scene = Scene(5000, place_mm=(200, 1.5))

    with pytest.raises(CalibrationError, match=r"inches apart if the line is as long as you say"):
        find_ticks(picture(scene), between(scene, 150, 250, 1.5), 100 / MM_PER_INCH * 0.68)


def test_a_pattern_that_is_not_periodic_has_no_ticks() -> None:
    """Smooth noise with plenty of contrast."""
    noise = np.random.default_rng(3).normal(0, 1, (40, 800)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    grey = np.clip(128 + 40 * smooth / smooth.std(), 0, 255).astype(np.uint8)

    with pytest.raises(CalibrationError):
        find_ticks(grey, Line((5, 20), (795, 20)), 6)
