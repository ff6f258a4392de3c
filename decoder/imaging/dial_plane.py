"""Dial planes: the map from a dial as seen square on to the panel picture, which rectifies oblique dials.

It is part of the map to the sample points of the unwrapped gauge, so there is still only one resampling. It comes from
points on a circle around the pivot (`rim`), or from the panel's reference points. Angles then are those of the dial
seen square on, and a radius is in pixels of the panel picture in the direction in which the dial appears largest, at
its centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.motion import Undetermined, carried, homography, jacobian
from decoder.imaging.optics import Optics
from decoder.imaging.planes import MIN_PAIRS, MIN_POINTS, DialPlane
from decoder.imaging.pose import pose_from_points
from decoder.imaging.thresholds import HAND_PART, MAX_REFERENCE_MISS
from decoder.panel.description import ReferencePoint
from decoder.panel.errors import PanelError, PoseError
from decoder.panel.gauge import Gauge
from decoder.panel.thresholds import LEAST_WINDOW_PX

Matrix = NDArray[np.float64]
Point = tuple[float, float]

# How precisely a point of the rim is marked by hand; and how much nearer one end of a dial may be than its middle, as
# for a dial a tenth of the picture wide, at 35 degrees.
RIM_SIGMA_PX = 0.3
PERSPECTIVE_PRIOR = 0.02
RIM_PASSES = 12


def inches_to_picture(
    points: Sequence[ReferencePoint], level: tuple[Point, Point] | None, optics: Optics
) -> Matrix | None:
    """(3, 3): inches on the panel to its picture, without distortion; None if the panel does not determine it.

    Raises
    ------
    PanelError
        If the reference points lie on one line, do not fit one plane, or allow two camera positions.
    """
    if len(points) < MIN_POINTS:
        return None
    inches = np.array([point.inches for point in points])
    at = np.array([point.at for point in points])
    straight = _straight(optics, at.T, "reference_points")
    if len(points) >= MIN_PAIRS:
        return _from_pairs(inches.T, straight)
    lens = optics.lens
    if lens is None:
        return None
    plumb = None if level is None else np.array(level)
    try:
        solutions = pose_from_points(inches, at, lens, plumb_px=plumb)
    except PoseError as error:
        raise PanelError("reference_points", str(error)) from error
    if len(solutions) > 1 and level is None:
        raise PanelError(
            "reference_points", "three leave two camera positions open; add a fourth, or `level`, to tell them apart"
        )
    return solutions[0].pose.homography(lens)


def dial_plane(gauge: Gauge, path: str, optics: Optics, inches: Matrix | None) -> DialPlane | None:
    """Find the plane of one dial; None if it counts as seen square on, without distortion.

    Raises
    ------
    PanelError
        If its `rim` is not a circle around its centre.
    """
    lens = optics.lens
    if gauge.is_in_picture:
        return _beside(gauge, path, optics) if lens is not None and lens.distorts else None
    x, y = _straight(optics, np.array([gauge.centre], np.float64).T, f"{path}.centre")[:, 0]
    centre = (float(x), float(y))
    if gauge.rim is not None:
        right = np.array([1.0, 0.0])
        if inches is not None:
            here = carried(np.asarray(np.linalg.inv(inches), np.float64), np.array([[x], [y]], np.float64))[:, 0]
            right = jacobian(inches, (float(here[0]), float(here[1])))[:, 0]
        rim = _straight(optics, np.array(gauge.rim, np.float64).T, f"{path}.rim")
        return _from_rim(rim, centre, right, path)
    if inches is not None:
        return _on_panel(inches, centre)
    if lens is not None and lens.distorts:
        return DialPlane((1.0, 0.0, centre[0], 0.0, 1.0, centre[1], 0.0, 0.0, 1.0))
    return None


def _beside(gauge: Gauge, path: str, optics: Optics) -> DialPlane:
    """Shift a gauge that is drawn as it appears as the lens shifts its middle; its centre may be far outside."""
    at, radius_px = math.radians(sum(gauge.sweep) / 2), sum(gauge.radius) / 2
    away = radius_px * np.array([[math.cos(at)], [math.sin(at)]])
    x, y = (_straight(optics, np.array([gauge.centre], np.float64).T + away, f"{path}.centre") - away)[:, 0].tolist()
    return DialPlane((1.0, 0.0, x, 0.0, 1.0, y, 0.0, 0.0, 1.0))


def _straight(optics: Optics, points: Matrix, path: str) -> Matrix:
    """(2, N) places in the panel picture, without distortion; PanelError where the lens shows nothing."""
    straight = optics.straight(points).astype(np.float64)
    if not np.isfinite(straight).all():
        raise PanelError(path, "lies where the lens, as camera.yaml describes it, shows nothing; check its distortion")
    return straight


def _from_pairs(inches: Matrix, at: Matrix) -> Matrix:
    try:
        matrix = homography(inches, at)
    except Undetermined:
        raise PanelError(
            "reference_points", "lie on one line, or all but one do; choose four of which no three are on a line"
        ) from None
    off = float(np.hypot(*(carried(matrix, inches) - at)).max())
    span = float(np.hypot(*np.ptp(at, axis=1)))
    if off > MAX_REFERENCE_MISS * span:
        raise PanelError(
            "reference_points",
            f"do not fit one plane, by {off:.1f} pixels; check that each `at` stands beside its own `inches`",
        )
    return matrix


def _on_panel(inches: Matrix, centre: Point) -> DialPlane:
    """Put the dial in the panel's plane: x as in the reference points, y clockwise as seen from the front."""
    x, y = carried(np.asarray(np.linalg.inv(inches), np.float64), np.array(centre)[:, None])[:, 0]
    here = jacobian(inches, (float(x), float(y)))
    largest = float(np.linalg.svd(here, compute_uv=False)[0])
    flip = 1.0 if np.linalg.det(here) > 0 else -1.0
    place = np.array([[1 / largest, 0.0, x], [0.0, flip / largest, y], [0.0, 0.0, 1.0]])
    return DialPlane.of(inches @ place)


def _from_rim(rim: Matrix, centre: Point, right: Matrix, path: str) -> DialPlane:
    """Fit the plane in which points lie on a circle around the centre, with as much perspective as it takes.

    Parameters
    ----------
    rim : (2, N) in the picture, without distortion
    right : (2,) the direction in the picture that is 0 degrees
    """
    away = rim - np.array(centre)[:, None]
    size = float(np.hypot(*away).mean())
    if size < LEAST_WINDOW_PX:
        raise PanelError(f"{path}.rim", "is a point; mark points all round a circle about the gauge's centre")
    shape, nearer = _unit_circle(away / size, size, path)
    # Any turn of the dial about its pivot explains the rim; the one with 0 degrees to the right is chosen.
    stretch = np.linalg.inv(_root(shape))
    first = np.linalg.solve(stretch, right)
    first /= np.hypot(*first)
    turn = np.array([[first[0], -first[1]], [first[1], first[0]]])
    linear = stretch @ turn
    largest = float(np.linalg.svd(linear, compute_uv=False)[0])
    own = np.eye(3)
    own[:2, :2] = linear / largest
    own[2, :2] = (nearer @ linear) / (largest * size)
    there = np.array([[1.0, 0.0, centre[0]], [0.0, 1.0, centre[1]], [0.0, 0.0, 1.0]])
    return DialPlane.of(there @ own)


def _unit_circle(away: Matrix, size_px: float, path: str) -> tuple[Matrix, Matrix]:
    """Find what maps points around the centre, (2, N) of size about one, to a unit circle.

    Returns
    -------
    (2, 2) the form S, and (2,) the perspective t: points p satisfy p' S p = (1 - t p)^2.
    """
    x, y = away
    rows = np.stack([x * x, 2 * x * y, y * y, 2 * x, 2 * y], axis=1)
    # With t small: p' S p + 2 t p - (t p)^2 = 1, the last term from the previous pass.
    t = np.zeros(2)
    prior = np.diag([1e-12] * 3 + [(2 * RIM_SIGMA_PX / size_px / PERSPECTIVE_PRIOR) ** 2] * 2)
    for _ in range(RIM_PASSES):
        wanted = 1.0 + (t @ away) ** 2
        solution = np.linalg.solve(rows.T @ rows + prior, rows.T @ wanted)
        t = solution[3:]
    shape = np.array([[solution[0], solution[1]], [solution[1], solution[2]]])
    if np.linalg.eigvalsh(shape)[0] <= 0:
        raise PanelError(f"{path}.rim", "is no circle around the gauge's centre; mark points all round it")
    radius = np.sqrt(np.einsum("in,ij,jn->n", away, shape, away)) / (1 - t @ away)
    if float(np.abs(radius - 1.0).max()) > HAND_PART:
        raise PanelError(f"{path}.rim", "is no circle around the gauge's centre; a point of it stands elsewhere")
    return shape, t


def _root(shape: Matrix) -> Matrix:
    """Take the symmetric root of a positive (2, 2) form."""
    values, directions = np.linalg.eigh(shape)
    return np.asarray(directions @ np.diag(np.sqrt(values)) @ directions.T)
