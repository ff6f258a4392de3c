"""Camera position and attitude: the truth is found, its uncertainty holds, and views of the panel are OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.imaging.camera_pose import Pose, PoseSolution, difference_of
from decoder.imaging.pose import pose_from_points
from decoder.panel.errors import PoseError
from decoder.panel.lens import BrownConrady, Lens
from fixtures.calibration.views import PIXELS_PER_RADIAN, PRINCIPAL_POINT_PX, SIZE_PX, View, projected, random_view
from tests.poses import pose_at

LENS = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN)
TRIANGLE = np.array([[0.0, 0.0], [8.0, 0.0], [3.0, 6.0]])
OBLIQUE = pose_at((-9.0, 12.0, 20.0), (4.0, 18.0, 28.0))


def written(view: View) -> np.ndarray:
    """(N, 3) a view's points as somebody writes them, heights towards the camera."""
    return view.points_inches * [1, 1, -1]


def true_pose(view: View) -> Pose:
    """Where the view was made from."""
    return Pose(view.rotation, view.translation_inches)


def nearest(solutions: tuple[PoseSolution, ...], view: View) -> PoseSolution:
    """The solution that is nearest to the truth."""
    return min(solutions, key=lambda solution: np.abs(solution.pose.rotation - view.rotation).max())


def test_all_solutions_of_three_points_are_those_of_opencv() -> None:
    """As many, and the same, as cv2.solveP3P has in front of the panel."""
    rng = np.random.default_rng(4)
    for _ in range(40):
        view = random_view(rng, 3)
        count, turns, shifts = cv2.solveP3P(
            view.points_inches, view.points_px, LENS.matrix, np.zeros(5), flags=cv2.SOLVEPNP_AP3P
        )
        theirs = [Pose(cv2.Rodrigues(turn)[0], shift.ravel()) for turn, shift in zip(turns, shifts, strict=True)]
        theirs = [pose for pose in theirs if pose.position_inches[2] > 0]
        ours = [s for s in pose_from_points(view.points_inches[:, :2], view.points_px, LENS) if s.exact]

        assert count >= len(ours)
        assert len(ours) == len(theirs)
        for pose in theirs:
            assert min(np.abs(difference_of(solution.pose, pose)).max() for solution in ours) < 1e-3


@pytest.mark.parametrize(("count", "relief_inches"), [(4, 0.8), (9, 0.0)])
def test_more_points_give_the_least_squares_of_opencv(count: int, relief_inches: float) -> None:
    """cv2's refinement by Levenberg and Marquardt ends at the same place."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        view = random_view(rng, count, relief_inches=relief_inches)
        marked = view.points_px + rng.normal(0, 0.3, view.points_px.shape)
        best = pose_from_points(written(view), marked, LENS)[0]
        turn, shift = cv2.solvePnPRefineLM(
            view.points_inches, marked, LENS.matrix, np.zeros(5), cv2.Rodrigues(view.rotation)[0],
            view.translation_inches[:, None].copy(), (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-15),
        )  # fmt: skip

        assert np.abs(difference_of(best.pose, Pose(cv2.Rodrigues(turn)[0], shift.ravel()))).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 8])
def test_the_claimed_covariance_holds(count: int) -> None:
    """With points marked to 0.3 px the squared error in units of the covariance is chi-square with six degrees."""
    rng = np.random.default_rng(6)
    squared = []
    for _ in range(200):
        view = random_view(rng, count)
        marked = view.points_px + rng.normal(0, 0.3, view.points_px.shape)
        found = nearest(pose_from_points(view.points_inches[:, :2], marked, LENS, sigma_px=0.3), view)
        error = difference_of(found.pose, true_pose(view))
        if found.trusted:
            squared.append(float(error @ np.linalg.solve(found.covariance, error)))

    assert len(squared) > 160
    assert np.mean(squared) == pytest.approx(6, abs=0.9)  # five standard errors of the mean of 160
    assert np.mean(np.array(squared) < 12.59) == pytest.approx(0.95, abs=0.05)


def test_points_through_a_distorting_lens_are_straightened() -> None:
    """The distortion is the lens's, not the view's."""
    view = random_view(np.random.default_rng(8), 3, distortion=np.array([-0.12, 0.02, 0.0, 0.0, 0.0]))
    lens = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN, distortion=BrownConrady((-0.12, 0.02, 0.0)))
    found = nearest(pose_from_points(view.points_inches[:, :2], view.points_px, lens), view)

    assert np.abs(difference_of(found.pose, true_pose(view))).max() < 1e-4


def test_y_may_be_counted_upwards() -> None:
    """The same camera, with the other sign of y; roll, pitch and yaw are the same."""
    pixels = OBLIQUE.pixels(TRIANGLE, LENS)
    down = pose_from_points(TRIANGLE, pixels, LENS)[0]
    up = pose_from_points(TRIANGLE * [1, -1], pixels, LENS)[0]

    assert (down.pose.y_up, up.pose.y_up) == (False, True)
    assert up.values == pytest.approx(down.values * [1, -1, 1, 1, 1, 1], abs=1e-6)


def test_a_plumb_edge_tells_the_solutions_of_three_points_apart() -> None:
    """The one in which the edge is vertical comes first; a fourth point leaves one."""
    pixels = OBLIQUE.pixels(TRIANGLE, LENS)
    edge = OBLIQUE.pixels(np.array([[1.0, 1.0], [1.0, 5.0]]), LENS)
    solutions = pose_from_points(TRIANGLE, pixels, LENS, plumb_px=edge)

    points = np.vstack([TRIANGLE, [[6.0, 7.0]]])

    assert len(solutions) == 2
    assert solutions[0].pose.position_inches == pytest.approx(OBLIQUE.position_inches, abs=1e-4)
    assert len(pose_from_points(points, OBLIQUE.pixels(points, LENS), LENS)) == 1


def test_an_uncertain_lens_makes_the_distance_uncertain() -> None:
    """Seen square on, a percent of one is a percent of the other."""
    square = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0], [0.0, 2.0]])
    pose = pose_at((0.0, 0.0, 30.0), (0.0, 0.0, 0.0))
    lens = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN, pixels_per_radian_sigma=17.0)
    (found,) = pose_from_points(square, pose.pixels(square, lens), lens, sigma_px=1e-4)

    assert found.sigmas[2] == pytest.approx(0.3, rel=0.01)


def test_points_that_are_marked_worse_than_said_widen_the_covariance() -> None:
    """By the ratio of variances."""
    rng = np.random.default_rng(9)
    view = random_view(rng, 12)
    marked = view.points_px + rng.normal(0, 3.0, view.points_px.shape)
    careful = pose_from_points(view.points_inches[:, :2], marked, LENS, sigma_px=3.0)[0]
    boasted = pose_from_points(view.points_inches[:, :2], marked, LENS, sigma_px=0.1)[0]

    assert boasted.sigmas == pytest.approx(careful.sigmas, rel=0.5)


def test_two_solutions_that_fall_together_are_not_trusted() -> None:
    """Directly above the circle through the points the two solutions coincide, and noise may leave none."""
    about = np.radians([90, 210, 330])
    circle = 5 * np.column_stack([np.cos(about), np.sin(about)])
    turned = cv2.Rodrigues(np.array([0.35, 0.0, 0.0]))[0]
    above = np.array([0.0, 5.0, -20.0])  # on the cylinder over the circle
    shift = -turned @ above
    pixels = projected(turned, shift, np.column_stack([circle, np.zeros(3)]))
    solutions = pose_from_points(circle, pixels, LENS)
    there = min(solutions, key=lambda s: np.abs(s.pose.rotation - turned).max())

    assert not there.trusted
    assert np.abs(difference_of(there.pose, Pose(turned, shift)) / there.sigmas).max() < 3


SEEN_PX = OBLIQUE.pixels(TRIANGLE, LENS)
FOLDED = Lens(SIZE_PX, PRINCIPAL_POINT_PX, PIXELS_PER_RADIAN, distortion=BrownConrady((-0.4, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("points", "pixels", "lens", "says"),
    [
        (TRIANGLE[:2], SEEN_PX[:2], LENS, "needs three reference points, here are 2"),
        ([[0.0, 0.0], [2.0, 1.0], [6.0, 3.0]], SEEN_PX, LENS, "on one line on the panel"),
        (TRIANGLE, [[0.0, 0.0], [100.0, 100.0], [201.0, 200.0]], LENS, "on one line in the picture"),
        (TRIANGLE, [[0.0, 0.0], [1000.0, 0.0], [500.0, 4000.0]], FOLDED, "where the lens shows nothing"),
    ],
)
def test_points_that_tell_no_pose_are_refused(points: object, pixels: object, lens: Lens, says: str) -> None:
    """Too few, on a line, seen from the panel's edge, or beyond the fold of a barrel lens: with the reason."""
    with pytest.raises(PoseError, match=says):
        pose_from_points(np.array(points), np.array(pixels), lens)


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


POINTS = st.tuples(st.floats(0, 1000), st.floats(0, 1000))
ROLLS = st.floats(-20, 20)


@given(panel=POINTS, frame=POINTS, roll_deg=ROLLS)
def test_pinned_point_goes_where_it_is_pinned(
    panel: tuple[float, float], frame: tuple[float, float], roll_deg: float
) -> None:
    """Whatever the roll, the pinned point of the panel is at its place in the frame."""
    alignment = Alignment.pinned(panel, frame, roll_deg, 0.9)

    assert alignment.to_frame(panel) == pytest.approx(frame, abs=1e-3)
    assert (alignment.roll_deg, alignment.score) == pytest.approx((roll_deg, 0.9))
