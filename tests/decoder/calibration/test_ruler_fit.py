"""Pixels per radian from a ruler: right to 0.05 % on rendered photographs, and the quadratic over the zooms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.calibration.focal_fit import fit_focal
from decoder.calibration.profile import Line
from decoder.calibration.ruler_fit import Marks, fit_ruler
from decoder.calibration.ticks import find_ticks
from decoder.errors import CalibrationError
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


@pytest.mark.parametrize(
    ("true", "across", "half"), [(1171, 6.2, 170), (2000, 28.5, 150), (5188, 1.5, 110), (11370, 28, 55)]
)
@pytest.mark.parametrize(("turn", "tilt"), [(0, 0), (-3, 3)])
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
