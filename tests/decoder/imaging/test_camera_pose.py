"""Alignments and views of the panel: signs that a person can check, and numbers that agree with OpenCV's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.imaging.camera_pose import Pose
from decoder.panel.lens import BrownConrady, Lens
from fixtures.calibration.views import PIXELS_PER_RADIAN, PRINCIPAL_POINT_PX, SIZE_PX, random_view
from tests.poses import pose_at

LENS = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN)
tilts = st.floats(-80, 80)


@pytest.mark.parametrize(
    ("position", "attitude", "point", "moves"),
    [
        ((1, 0, 20), (0, 0, 0), (0, 0), (-1, 0)),  # the camera moves right, the panel left
        ((0, 1, 20), (0, 0, 0), (0, 0), (0, -1)),  # it moves down, the panel up
        ((0, 0, 20), (0, 5, 0), (0, 0), (0, 1)),  # it looks up, the panel sinks
        ((0, 0, 20), (0, 0, 5), (0, 0), (-1, 0)),  # it looks right, the panel moves left
        ((0, 0, 20), (10, 0, 0), (2, 0), (1, -1)),  # it rolls clockwise, a point on the right rises
    ],
)
def test_signs(position: tuple, attitude: tuple, point: tuple, moves: tuple) -> None:
    """As somebody behind the camera sees it."""
    shift = pose_at(position, attitude).pixels(np.array([point], float), LENS)[0] - PRINCIPAL_POINT_PX

    assert np.sign(np.round(shift, 6)) == pytest.approx(moves)


@given(
    position=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 50)),
    attitude=st.tuples(st.floats(-179, 179), tilts, tilts),
    y_up=st.booleans(),
)
def test_position_and_attitude_come_back(position: tuple, attitude: tuple, y_up: bool) -> None:  # noqa: FBT001
    """pose_at and its two properties undo each other."""
    pose = pose_at(position, attitude, y_up=y_up)

    assert pose.position_inches == pytest.approx(position, abs=1e-9)
    assert pose.attitude_deg == pytest.approx(attitude, abs=1e-9)


@pytest.mark.parametrize("y_up", [False, True])
def test_pixels_are_opencv_s(y_up: bool) -> None:  # noqa: FBT001
    """With heights above the panel and distortion, whichever way y is counted."""
    rng = np.random.default_rng(7)
    distortion = np.array([-0.1, 0.01, 0.001, -0.002, 0.0])
    view = random_view(rng, 12, relief_inches=1.0, distortion=distortion)
    lens = Lens(
        SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN, distortion=BrownConrady((-0.1, 0.01, 0.0), (0.001, -0.002))
    )
    written = view.points_inches * [1, -1 if y_up else 1, -1]

    pose = Pose(view.rotation, view.translation_inches, y_up)

    assert pose.pixels(written, lens) == pytest.approx(view.points_px, abs=1e-8)


@given(height=st.floats(-1, 1), y_up=st.booleans())
def test_the_homography_is_the_view_of_one_height(height: float, y_up: bool) -> None:  # noqa: FBT001
    """It shows the points of that height where `pixels` does."""
    pose = pose_at((1, -2, 15), (10, 20, -25), y_up=y_up)
    points = np.array([[0.0, 0.0], [3.0, 1.0], [-2.0, 4.0]])
    seen = pose.homography(LENS, height) @ np.column_stack([points, np.ones(3)]).T
    raised = np.column_stack([points, [height] * 3])

    assert pose.pixels(raised, LENS) == pytest.approx((seen[:2] / seen[2]).T, abs=1e-8)


POINTS = st.tuples(st.floats(0, 1000), st.floats(0, 1000))
ROLLS = st.floats(-20, 20)


@given(panel=POINTS, frame=POINTS, roll_deg=ROLLS)
def test_pinned_point_goes_where_it_is_pinned(
    panel: tuple[float, float], frame: tuple[float, float], roll_deg: float
) -> None:
    """Whatever the roll, the pinned point of the panel lies on its place in the frame."""
    alignment = Alignment.pinned(panel, frame, roll_deg, 0.9)

    assert alignment.to_frame(panel) == pytest.approx(frame, abs=1e-3)
    assert (alignment.roll_deg, alignment.score) == pytest.approx((roll_deg, 0.9))
