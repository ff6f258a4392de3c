"""Camera position and attitude from reference points: thesis 3.1.2 for three, least squares for more.

Three points have up to four such places. The thesis starts from a guess and finds one; here Grunert's quartic gives a
guess for each. Source: Haralick et al., "Review and analysis of solutions of the three point perspective pose
estimation problem", IJCV 13 (1994).

    solutions = pose_from_points(points_inches, points_px, lens)
    best = solutions[0]                      # all that fit, best first; usually one, with three points often two
    best.pose.homography(lens)               # inches on the panel to undistorted pixels

Three points fit exactly, so only a further point, or a line known to be vertical, can tell several solutions apart.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from decoder.imaging.camera_pose import (
    Iterated,
    Matrix,
    Measured,
    Pose,
    PoseSolution,
    difference_of,
    inside,
    iterate,
    solution_of,
    variance_px2,
)
from decoder.imaging.planes import MIN_POINTS
from decoder.imaging.thresholds import MAX_SIDE_MISS, NEARLY_REAL, SAME_POSE, THINNEST, TRUSTED_SIGMAS
from decoder.panel.errors import DegeneratePoints, PoseError
from decoder.panel.lens import Lens

SIGMA_PX = 0.3
"""How uncertain a point that was marked by hand is, in x and in y."""

_TRIANGLES = 4
_PLAUSIBLE = 16.0  # solutions are dropped if their squared error, in variances, exceeds the best one's by more


def guesses(points_inches: Matrix, normalised: Matrix) -> list[Pose]:
    """Find poses that show three points about where they are.

    Parameters
    ----------
    points_inches : (3, 3) in the panel's internal axes
    normalised : (3, 2) where they are seen, in undistorted normalised coordinates

    Returns
    -------
    list of Pose, at most eight, some of them near each other; empty if there is no place at all
    """
    sights = np.column_stack([normalised, np.ones(3)])
    sights /= np.linalg.norm(sights, axis=1)[:, None]
    return [moved(points_inches, distances[:, None] * sights) for distances in _distances(points_inches, sights)]


def moved(points: Matrix, onto: Matrix) -> Pose:
    """Fit the rigid movement that brings (N, 3) points onto others, by least squares (Kabsch)."""
    middle, goal = points.mean(axis=0), onto.mean(axis=0)
    left, _, right = np.linalg.svd((onto - goal).T @ (points - middle))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ mirror @ right
    return Pose(rotation, goal - rotation @ middle)


def _distances(points: Matrix, sights: Matrix) -> list[Matrix]:
    """(3,) distances of the points along their sights, for each guess."""
    a, b, c = (float(np.sum((points[i] - points[j]) ** 2)) for i, j in ((1, 2), (0, 2), (0, 1)))  # squared sides
    cos_a, cos_b, cos_c = (float(sights[i] @ sights[j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    found = []
    for root, sign in product(np.roots(_quartic((a, b, c), (cos_a, cos_b, cos_c))), (-1.0, 1.0)):
        third = float(root.real)
        if third <= 0 or abs(root.imag) > NEARLY_REAL * abs(root):
            continue
        first = np.sqrt(b / (1 + third**2 - 2 * third * cos_b))
        second = cos_c + sign * np.sqrt(max(cos_c**2 - 1 + c / first**2, 0.0))
        side = first**2 * (second**2 + third**2 - 2 * second * third * cos_a)
        if second > 0 and abs(side / a - 1) < MAX_SIDE_MISS:
            found.append(first * np.array([1.0, second, third]))
    return found


def _quartic(squares: tuple[float, float, float], cosines: tuple[float, float, float]) -> list[float]:
    """Grunert's quartic in the ratio of the third distance to the first, highest power first."""
    (a, b, c), (cos_a, cos_b, cos_c) = squares, cosines
    less, more, far, near = (a - c) / b, (a + c) / b, a / b, c / b
    return [
        (less - 1) ** 2 - 4 * near * cos_a**2,
        4 * (less * (1 - less) * cos_b - (1 - more) * cos_a * cos_c + 2 * near * cos_a**2 * cos_b),
        2
        * (
            less**2
            - 1
            + 2 * less**2 * cos_b**2
            + 2 * (1 - near) * cos_a**2
            - 4 * more * cos_a * cos_b * cos_c
            + 2 * (1 - far) * cos_c**2
        ),
        4 * (-less * (1 + less) * cos_b + 2 * far * cos_c**2 * cos_b - (1 - more) * cos_a * cos_c),
        (1 + less) ** 2 - 4 * far * cos_c**2,
    ]


def pose_from_points(
    points_inches: Matrix,
    points_px: Matrix,
    lens: Lens,
    *,
    sigma_px: float = SIGMA_PX,
    plumb_px: Matrix | None = None,
) -> tuple[PoseSolution, ...]:
    """Find all camera poses that show reference points where the picture has them, best first.

    Parameters
    ----------
    points_inches : (N, 2) on the panel's plane, or (N, 3) with heights towards the camera; N >= 3; x right, y up or
        down, which is determined from the picture
    points_px : (N, 2) where the picture shows them, as taken
    lens : of that picture
    sigma_px : standard uncertainty of `points_px` in x and in y
    plumb_px : (2, 2) both ends, in the picture, of an edge that is vertical on the panel; distinguishes the solutions
        of three points. Without it the one nearest to square on is the best.

    Raises
    ------
    DegeneratePoints
        If there are fewer than three points, or they lie on one line on the panel or in the picture.
    PoseError
        If there is no place from which they look like that.
    """
    points_inches, points_px = np.asarray(points_inches, np.float64), np.asarray(points_px, np.float64)
    straight = lens.undistorted(points_px.T).T
    _refuse_degenerate(points_inches, straight)
    y_up = _is_mirrored(points_inches, straight)
    measured = Measured(inside(points_inches, y_up=y_up), straight, lens)
    found = _settled(measured, y_up=y_up, near_px=TRUSTED_SIGMAS * sigma_px)
    solutions = _distinct([(iterated.settled, solution_of(measured, iterated, sigma_px)) for iterated in found])
    if not solutions:
        raise PoseError(
            "no camera position shows the reference points like that; check that each `at` stands beside its own"
            " `inches`, and the picture's focal length"
        )
    if len(points_px) > MIN_POINTS:
        return _plausible(solutions, measured, sigma_px)
    if plumb_px is not None:
        ends = lens.undistorted(np.asarray(plumb_px, np.float64).T)
        return tuple(sorted(solutions, key=lambda solution: off_plumb_deg(solution.pose, lens, ends)))
    return tuple(sorted(solutions, key=lambda solution: (not solution.exact, solution.pose.tilt_deg)))


def _plausible(solutions: list[PoseSolution], measured: Measured, sigma_px: float) -> tuple[PoseSolution, ...]:
    """Keep the solution with the least residuals, and those that the points' uncertainty cannot distinguish from it."""
    ordered = sorted(solutions, key=lambda solution: solution.rms_px)
    count = measured.points_px.size
    limit = ordered[0].rms_px ** 2 + _PLAUSIBLE * variance_px2(ordered[0], measured, sigma_px) / count
    return tuple(solution for solution in ordered if solution.rms_px**2 <= limit)


def off_plumb_deg(pose: Pose, lens: Lens, ends_px: Matrix) -> float:
    """Return how far an edge in the picture, (2, 2) with a row of x and one of y, undistorted, is off the vertical."""
    on_panel = np.linalg.inv(pose.homography(lens)) @ np.vstack([ends_px, np.ones(2)])
    (x0, x1), (y0, y1) = on_panel[:2] / on_panel[2]
    return float(np.degrees(np.arctan2(abs(x1 - x0), abs(y1 - y0))))


def _refuse_degenerate(points_inches: Matrix, points_px: Matrix) -> None:
    if len(points_inches) < MIN_POINTS:
        raise DegeneratePoints(f"a camera position needs three reference points, here are {len(points_inches)}")
    if not np.isfinite(points_px).all():
        raise PoseError("a reference point lies where the lens shows nothing; check the camera's distortion")
    for points, place in ((points_inches, "on the panel"), (points_px, "in the picture")):
        if _breadth(points) < THINNEST:
            raise DegeneratePoints(
                f"the reference points lie on one line {place}, about which the camera may be turned at will;"
                " choose three that span a triangle"
            )


def _breadth(points: Matrix) -> float:
    """Measure the pattern's breadth as a part of its length."""
    spreads = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(spreads[1] / spreads[0]) if spreads[0] > 0 else 0.0


def _is_mirrored(points_inches: Matrix, points_px: Matrix) -> bool:
    """Whether y grows upwards on the panel, since from the front x right and y down turn like the picture's pixels."""
    flat = points_inches[:, :2] - points_inches[:, :2].mean(axis=0)
    affine = np.linalg.lstsq(flat, points_px - points_px.mean(axis=0), rcond=None)[0]
    return bool(np.linalg.det(affine) < 0)


def _settled(measured: Measured, *, y_up: bool, near_px: float) -> list[Iterated]:
    """Iterate from every guess and return each place once, with the camera in front of the panel."""
    found: list[Iterated] = []
    for guess in _starts(measured):
        iterated = iterate(measured, Pose(guess.rotation, guess.translation_inches, y_up))
        fits = iterated.settled or np.linalg.norm(measured.residuals_px(iterated.pose)) < near_px
        in_front = iterated.pose.position_inches[2] > 0
        if fits and in_front and not any(_is_same(iterated.pose, known.pose) for known in found):
            found.append(iterated)
    return found


def _distinct(found: list[tuple[bool, PoseSolution]]) -> list[PoseSolution]:
    """Return all that fit, and those that nearly fit unless they coincide, within uncertainty, with one that fits."""
    fitting = [solution for settled, solution in found if settled]
    nearly = [solution for settled, solution in found if not settled]
    return fitting + [one for one in nearly if not any(_within(one, other) for other in fitting)]


def _within(one: PoseSolution, other: PoseSolution) -> bool:
    difference = difference_of(other.pose, one.pose)
    return bool(difference @ np.linalg.lstsq(one.covariance, difference, rcond=None)[0] < TRUSTED_SIGMAS**2)


def _starts(measured: Measured) -> list[Pose]:
    """Return guesses from the largest triangles among the points."""

    def area_px(three: tuple[int, ...]) -> float:
        first, second, third = measured.points_px[list(three)]
        return -abs(float(np.linalg.det(np.stack([second - first, third - first]))))

    normalised = measured.lens.normalised(measured.points_px.T).T
    widest = sorted(_triangles(measured.points_px), key=area_px)[:_TRIANGLES]
    return [
        guess for three in widest for guess in guesses(measured.points_inches[list(three)], normalised[list(three)])
    ]


def _triangles(points_px: Matrix) -> list[tuple[int, ...]]:
    """List triangles among the points; if there are many, only among those outermost in eight directions."""
    angles = np.arange(8) * np.pi / 4
    outermost = np.argmax(points_px @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
    chosen = sorted({int(index) for index in outermost})
    if len(chosen) < MIN_POINTS or len(points_px) <= len(angles):
        chosen = list(range(len(points_px)))
    return list(combinations(chosen, MIN_POINTS))


def _is_same(one: Pose, other: Pose) -> bool:
    turn = np.abs(one.rotation - other.rotation).max()
    shift = np.abs(one.translation_inches - other.translation_inches).max() / np.abs(one.translation_inches).max()
    return bool(max(turn, shift) < SAME_POSE)
