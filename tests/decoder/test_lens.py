"""The lens: distorting and undistorting undo each other, and agree with OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.lens import Lens

SIZE = (1616, 1212)
coefficient = st.floats(-0.15, 0.15)
small = st.floats(-0.01, 0.01)


def grid() -> np.ndarray:
    """(2, 117) pixels all over the picture, its corners among them."""
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 13), np.linspace(0, SIZE[1] - 1, 9))
    return np.stack([x.ravel(), y.ravel()])


def lens(k1: float, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0, k3: float = 0.0) -> Lens:
    """A wide lens with its axis off the middle."""
    return Lens(SIZE, (800.3, 611.9), 1400.0, radial=(k1, k2, k3), tangential=(p1, p2))


@given(k1=coefficient, k2=small, p1=small, p2=small, k3=small)
def test_undistorting_undoes_distorting(k1: float, k2: float, p1: float, p2: float, k3: float) -> None:
    """To a millionth of a pixel, all over the picture."""
    bent = lens(k1, k2, p1, p2, k3)

    assert bent.undistorted(bent.distorted(grid())) == pytest.approx(grid(), abs=1e-6)
    assert bent.distorted(bent.undistorted(grid())) == pytest.approx(grid(), abs=1e-6)


@given(k1=coefficient, k2=small, p1=small, p2=small, k3=small)
def test_distorting_is_opencv_s(k1: float, k2: float, p1: float, p2: float, k3: float) -> None:
    """As cv2.projectPoints has it."""
    bent = lens(k1, k2, p1, p2, k3)
    sights = np.vstack([bent.normalised(grid()), np.ones((1, grid().shape[1]))])
    nowhere = np.zeros(3)
    projected, _ = cv2.projectPoints(sights.T.copy(), nowhere, nowhere, bent.matrix, bent.coefficients)

    assert bent.distorted(grid()) == pytest.approx(projected[:, 0].T, abs=1e-6)


def test_undistorting_is_opencv_s() -> None:
    """As cv2.undistortPoints has it when it iterates to the end."""
    bent = lens(-0.12, 0.01, 0.002, -0.001, 0.003)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    points = cv2.undistortImagePoints(grid().T.reshape(-1, 1, 2).copy(), bent.matrix, bent.coefficients, None, criteria)

    assert bent.undistorted(grid()) == pytest.approx(points[:, 0].T, abs=1e-6)


def test_barrel_distortion_draws_the_corners_in() -> None:
    """Negative k1; the axis stays where it is."""
    bent = lens(-0.1)
    points = np.array([[800.3, 0.0], [611.9, 0.0]])

    assert bent.distorted(points)[:, 0] == pytest.approx(points[:, 0])
    assert np.all(bent.distorted(points)[:, 1] > 0)


def test_a_pinhole_changes_nothing() -> None:
    """Not a bit of it."""
    assert not lens(0.0).distorts
    assert np.array_equal(lens(0.0).undistorted(grid()), grid())
    assert np.array_equal(lens(0.0).distorted(grid()), grid())


def test_where_no_line_of_sight_arrives_there_is_no_number() -> None:
    """A barrel lens sees nothing beyond its fold; what is near the axis is not disturbed by it."""
    bent = lens(-0.15)
    points = bent.undistorted(np.array([[810.0, 9000.0], [600.0, 9000.0]]))

    assert np.isfinite(points[:, 0]).all()
    assert np.isnan(points[:, 1]).all()


def test_no_points_are_no_trouble() -> None:
    """An empty array stays one."""
    assert lens(-0.1).undistorted(np.zeros((2, 0))).shape == (2, 0)
