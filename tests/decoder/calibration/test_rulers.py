"""Rulers: their ticks, pixels per radian, the quadratic over the zooms, and camera.yaml with its content kept."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.calibration.camera_file import merged
from decoder.calibration.focal_fit import fit_focal
from decoder.calibration.profile import Line
from decoder.calibration.ruler_fit import Marks, fit_ruler
from decoder.calibration.ticks import GRADUATIONS_INCHES, find_ticks
from decoder.panel.errors import CalibrationError, CameraError
from fixtures.calibration.ruler import Scene, picture

SIZE = (1616, 1212)


def marks(scene: Scene, places_inches: list[float], across_mm: float = 1.5) -> Marks:
    """Marks exactly where the ruler has them."""
    middle_mm = scene.place_mm[0]
    points = [scene.pixel(middle_mm + place * 25.4, across_mm) for place in places_inches]
    return Marks(np.array(points), np.array(places_inches))


@given(
    true=st.floats(800, 12000), tilt=st.floats(-8, 8), turn=st.floats(-170, 170), distance=st.floats(20, 60),
    off=st.floats(-0.5, 0.5),
)  # fmt: skip
def test_the_centre_of_the_field_is_found_whatever_the_tilt(
    true: float, tilt: float, turn: float, distance: float, off: float
) -> None:
    """Exactly, from exact marks, however the ruler is turned, tilted and pushed along."""
    scene = Scene(true, tilt_deg=tilt, turn_deg=turn, distance_inches=distance)
    half = 0.4 * distance * 1000 / true
    fit = fit_ruler(
        marks(scene, [half * (part + off) for part in (-1, -0.6, -0.3, 0, 0.2, 0.5, 1)]),
        distance_inches=distance, size_px=SIZE,
    )  # fmt: skip

    assert fit.pixels_per_radian == pytest.approx(true, rel=1e-6)
    assert fit.tilt_deg == pytest.approx(tilt, abs=1e-3)


def test_both_forms_of_the_thesis() -> None:
    """Six inches at 36, square on: the small angle is the centre's, the arctangent's mean is 0.23 % more."""
    fit = fit_ruler(marks(Scene(3000.0), [-3, 3]), distance_inches=36, size_px=SIZE)

    assert fit.pixels_per_radian == pytest.approx(3000)
    assert fit.small_angle == pytest.approx(3000)
    assert fit.arctangent == pytest.approx(500 / (2 * np.arctan(3 / 36)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("true", "across", "half", "turn", "tilt"),
    [(1171, 6.2, 170, -3, 3), (2000, 28.5, 150, 0, 0), (5188, 1.5, 110, 0, 0), (11370, 28, 55, -3, 3)],
)
def test_rendered_rulers_give_pixels_per_radian_to_a_twentieth_of_a_percent(
    true: float, across: float, half: float, turn: float, tilt: float
) -> None:
    """With blur, noise and numerals, from the widest zoom to the longest; the claimed uncertainty is not too small."""
    scene = Scene(true, turn_deg=turn, tilt_deg=tilt, place_mm=(200, across), seed=5)
    line = Line(scene.pixel(200 - half, across), scene.pixel(200 + half, across))
    ticks = find_ticks(picture(scene), line, 2 * half / 25.4)
    fit = fit_ruler(Marks(ticks.points_px, ticks.inches), distance_inches=36, size_px=SIZE)

    assert fit.pixels_per_radian == pytest.approx(true, rel=2e-4)
    assert abs(fit.pixels_per_radian - true) < 4 * fit.sigma + 1e-5 * true
    assert fit.tilt_deg == pytest.approx(tilt, abs=0.3)


def test_a_ruler_that_misses_the_middle_is_refused() -> None:
    """Beside it, or all on one side of it."""
    with pytest.raises(CalibrationError, match=r"misses the middle of the picture by 2\d\d pixels"):
        fit_ruler(marks(Scene(3000.0), [-3, 3], across_mm=80), distance_inches=36, size_px=SIZE)
    with pytest.raises(CalibrationError, match="all on one side of the picture's middle"):
        fit_ruler(marks(Scene(3000.0), [3, 5, 8]), distance_inches=36, size_px=SIZE)


def test_the_quadratic_comes_back() -> None:
    """With the covariance of its noise and of the distance."""
    lengths = np.linspace(4.45, 44.5, 12)
    true = np.array([8.0, 262.0, -0.15])
    exact = np.polynomial.polynomial.polyval(lengths, true)
    rng = np.random.default_rng(2)
    squared = []
    for _ in range(300):
        fit = fit_focal(lengths, exact + rng.normal(0, 1.0, 12), np.ones(12), scale_sigma=0.0)
        error = fit.coefficients - true
        squared.append(error @ np.linalg.solve(fit.covariance, error))
    shared = fit_focal(lengths, exact, np.ones(12), scale_sigma=0.01)
    powers = np.array([1, 20, 400])

    assert np.mean(squared) == pytest.approx(2.75, abs=0.6)  # three, less for fits that widen their covariance
    assert shared.coefficients == pytest.approx(true)
    assert np.sqrt(powers @ shared.covariance @ powers) == pytest.approx(0.01 * (powers @ true), rel=0.01)


@pytest.mark.parametrize(
    ("lengths", "says"), [([4.45, 4.45], "here is one zoom"), ([4.45, 10.0, 10.0], "here are 2 zooms")]
)
def test_too_few_zooms_are_refused(lengths: list[float], says: str) -> None:
    """A quadratic has three unknowns."""
    with pytest.raises(CalibrationError, match=says):
        fit_focal(np.array(lengths), np.ones(len(lengths)), np.ones(len(lengths)), scale_sigma=0)


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
        (11650, 4.2, 145, 255, "5 mm", 0.015),
        (11650, 28.0, 145, 255, "1/16 inch", 0.015),
    ],
)
def test_ticks_are_where_they_are(
    pixels_per_radian: float, across_mm: float, first_mm: float, last_mm: float, graduation: str, within_px: float
) -> None:
    """Whatever the zoom and the edge of the ruler; the graduation is given, the length need only be roughly right."""
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


@pytest.mark.parametrize("is_dark", [False, True])
def test_ticks_that_are_covered_are_left_out_and_the_others_keep_their_numbers(is_dark: bool) -> None:  # noqa: FBT001
    """A thumb on the ruler, which may be black with bright ticks."""
    scene = Scene(5000, place_mm=(200, 1.5))
    covered = 255 - picture(scene) if is_dark else picture(scene)
    left, right = int(scene.pixel(183.5, 0)[0]), int(scene.pixel(197.5, 0)[0])
    covered[:, left:right] = 150
    ticks = find_ticks(covered, between(scene, 150.5, 249.5, 1.5), 99 / MM_PER_INCH)
    shown_mm = 151 + ticks.number

    error = ticks.points_px[:, 0] - [scene.pixel(place, 1.5)[0] for place in shown_mm]

    assert 14 <= 99 - len(ticks.number) <= 21
    assert np.abs(error).max() < 0.06


@pytest.mark.parametrize(
    ("across_mm", "inches", "says"),
    [
        (-20.0, 3.94, "no ticks are found on the line; draw it"),
        (14.5, 3.94, "no ticks are found on the line; draw it"),
        (1.5, 2.68, "inches apart if the line is as long as you say"),
    ],
    ids=["beside it", "along its numerals", "of another length"],
)
def test_line_without_the_ticks_of_a_ruler_is_refused(across_mm: float, inches: float, says: str) -> None:
    """Ticks are missed rather than guessed."""
    scene = Scene(5000, place_mm=(200, 1.5))

    with pytest.raises(CalibrationError, match=says):
        find_ticks(picture(scene), between(scene, 150, 250, across_mm), inches)


def test_a_pattern_that_is_not_periodic_has_no_ticks() -> None:
    """Smooth noise with plenty of contrast."""
    smooth = cv2.GaussianBlur(np.random.default_rng(3).normal(0, 1, (40, 800)).astype(np.float32), (0, 0), 3)
    grey = np.clip(128 + 40 * smooth / smooth.std(), 0, 255).astype(np.uint8)

    with pytest.raises(CalibrationError):
        find_ticks(grey, Line((5, 20), (795, 20)), 6)


FOCAL = {"pixels_per_radian": [0.0, 262.0, 0.0], "range_mm": [4.0, 45.0]}


def test_distortion_replaces_its_own_zoom_only() -> None:
    """The others stay."""
    first = merged(None, picture_size=(1616, 1212), focal=FOCAL, distortion=[{"focal_length_mm": 4.45, "k1": -0.1}])
    second = merged(first, distortion=[{"focal_length_mm": 10.0, "k1": -0.02}])
    third = merged(second, distortion=[{"focal_length_mm": 4.45, "k1": -0.2}])

    assert [(entry.focal_length_mm, entry.k1) for entry in third.distortion] == [(4.45, -0.2), (10.0, -0.02)]
    assert third.focal == first.focal


def test_another_picture_size_is_not_mixed_in() -> None:
    """The numbers would not fit each other."""
    known = merged(None, picture_size=(1616, 1212), focal=FOCAL)

    with pytest.raises(CameraError, match="made from pictures of 1616 x 1212"):
        merged(known, picture_size=(4896, 3672), focal=FOCAL)


def test_a_quadratic_that_falls_is_refused() -> None:
    """Points by hand at three zooms may give one."""
    with pytest.raises(CameraError, match="what was measured: focal: pixels_per_radian must be positive"):
        merged(None, picture_size=(1616, 1212), focal={**FOCAL, "pixels_per_radian": [0.0, 10.0, -5.0]})
