"""Dial planes: the map from a dial as seen square on to the panel picture, so that oblique dials are squared up.

It is folded into the sample points of the unwrapped gauge: there is still one resampling. It comes from points on a
circle round the pivot (`rim`), or from the panel's reference points. Angles then are those of the dial seen square on,
and a radius is in pixels of the panel picture in the direction in which the dial appears largest, at its centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats
from decoder.calibration.pose import pose_from_points
from decoder.errors import PanelError, PoseError
from decoder.gauge import Gauge
from decoder.optics import Optics
from decoder.panel import Panel
from decoder.plane_fit import MIN_PAIRS, Undetermined, carried, homography, jacobian

Matrix = NDArray[np.float64]
Point = tuple[float, float]

MIN_POSE_POINTS = 3
# How well a point of the rim is marked by hand, and how much nearer one end of a dial may be than its middle: a dial
# that is a tenth of the picture wide, at 35 degrees.
RIM_SIGMA_PX = 0.3
PERSPECTIVE_PRIOR = 0.02
RIM_PASSES = 12
LEAST_RIM_PX = 1.0
MAX_RIM_MISS = 0.1
MAX_REFERENCE_MISS = 0.03


@dataclass(frozen=True, slots=True)
class DialPlane:
    """The dial's own plane, in pixels from the pivot, x to 0 degrees, y to 90 degrees, on the panel picture.

    `elements` are those of a (3, 3) matrix, row by row; the panel picture is without distortion.
    """

    elements: tuple[float, ...]

    @classmethod
    def of(cls, matrix: Floats) -> Self:
        """With this matrix."""
        return cls(tuple((matrix / matrix[2, 2]).ravel().tolist()))

    @property
    def matrix(self) -> Matrix:
        """(3, 3)."""
        return np.array(self.elements).reshape(3, 3)

    def to_panel(self, points: Floats) -> Floats:
        """(2, N) points of the dial in the panel picture."""
        return carried(self.matrix, np.asarray(points, np.float64))

    def around(self, offset_px: Point) -> DialPlane:
        """The same plane with its pivot at a point of it."""
        x, y = offset_px
        return DialPlane.of(self.matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]))


def inches_to_picture(panel: Panel, optics: Optics) -> Matrix | None:
    """(3, 3): inches on the panel to its picture, without distortion; None where the panel does not tell.

    Raises
    ------
    PanelError
        If the reference points lie on one line, do not fit one plane, or leave two camera positions open.
    """
    points = panel.reference_points
    if len(points) < MIN_POSE_POINTS:
        return None
    inches = np.array([point.inches for point in points])
    at = np.array([point.at for point in points])
    if len(points) >= MIN_PAIRS:
        return _from_pairs(inches.T, optics.straight(at.T).astype(np.float64))
    lens = optics.lens
    if lens is None:
        return None
    plumb = None if panel.level is None else np.array(panel.level)
    try:
        solutions = pose_from_points(inches, at, lens, plumb_px=plumb)
    except PoseError as error:
        raise PanelError("reference_points", str(error)) from error
    if len(solutions) > 1 and panel.level is None:
        raise PanelError(
            "reference_points", "three leave two camera positions open; add a fourth, or `level`, to tell them apart"
        )
    return solutions[0].pose.homography(lens)


def dial_plane(gauge: Gauge, path: str, optics: Optics, inches: Matrix | None) -> DialPlane | None:
    """The plane of one dial; None where it counts as seen square on, without distortion.

    Raises
    ------
    PanelError
        If its `rim` is no circle around its centre.
    """
    lens = optics.lens
    x, y = optics.straight(np.array([[gauge.centre[0]], [gauge.centre[1]]], np.float64))[:, 0]
    centre = (float(x), float(y))
    if gauge.rim is not None:
        right = np.array([1.0, 0.0])
        if inches is not None:
            here = carried(np.asarray(np.linalg.inv(inches), np.float64), np.array([[x], [y]], np.float64))[:, 0]
            right = jacobian(inches, (float(here[0]), float(here[1])))[:, 0]
        rim = optics.straight(np.array(gauge.rim, np.float64).T).astype(np.float64)
        return _from_rim(rim, centre, right, path)
    if inches is not None:
        return _on_panel(inches, centre)
    if lens is not None and lens.distorts:
        return DialPlane((1.0, 0.0, centre[0], 0.0, 1.0, centre[1], 0.0, 0.0, 1.0))
    return None


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
    """The dial in the panel's plane: x as the reference points count it, y so that clockwise is as seen in front."""
    x, y = carried(np.asarray(np.linalg.inv(inches), np.float64), np.array(centre)[:, None])[:, 0]
    here = jacobian(inches, (float(x), float(y)))
    largest = float(np.linalg.svd(here, compute_uv=False)[0])
    flip = 1.0 if np.linalg.det(here) > 0 else -1.0
    place = np.array([[1 / largest, 0.0, x], [0.0, flip / largest, y], [0.0, 0.0, 1.0]])
    return DialPlane.of(inches @ place)


def _from_rim(rim: Matrix, centre: Point, right: Matrix, path: str) -> DialPlane:
    """The plane in which points lie on a circle around the centre: an affine map, and as much perspective as it takes.

    Parameters
    ----------
    rim : (2, N) in the picture, without distortion
    right : (2,) the direction in the picture that is 0 degrees
    """
    away = rim - np.array(centre)[:, None]
    size = float(np.hypot(*away).mean())
    if size < LEAST_RIM_PX:
        raise PanelError(f"{path}.rim", "is a point; mark points all round a circle about the gauge's centre")
    shape, nearer = _unit_circle(away / size, size, path)
    # Any turn of the dial about its pivot explains the rim: the one that has 0 degrees to the right is taken.
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
    """What makes points from the centre, (2, N) of size about one, a unit circle.

    Returns
    -------
    (2, 2) the form S, and (2,) the perspective t: points p lie where p' S p = (1 - t p)^2.
    """
    x, y = away
    rows = np.stack([x * x, 2 * x * y, y * y, 2 * x, 2 * y], axis=1)
    # With t small: p' S p + 2 t p - (t p)^2 = 1, the last term from the pass before.
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
    if float(np.abs(radius - 1.0).max()) > MAX_RIM_MISS:
        raise PanelError(f"{path}.rim", "is no circle around the gauge's centre; a point of it stands elsewhere")
    return shape, t


def _root(shape: Matrix) -> Matrix:
    """The symmetric root of a positive (2, 2) form."""
    values, directions = np.linalg.eigh(shape)
    return np.asarray(directions @ np.diag(np.sqrt(values)) @ directions.T)
