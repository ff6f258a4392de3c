"""Plane-to-plane transformations from points: a homography from four or more pairs, by least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decoder.motion import Frame2D, Model

Matrix = NDArray[np.float64]

MIN_PAIRS = 4
POLISHING_PASSES = 6
# Singular values of the equations of normalised points: below it more than one transformation fits.
LEAST_CONDITION = 2e-3


class Undetermined(ValueError):
    """More than one transformation fits the points: too many of them lie on one line."""


def homography(points: Matrix, there: Matrix) -> Matrix:
    """(3, 3): carries (2, N) points to (2, N) others, N >= 4, with the least squared distances there.

    Raises
    ------
    Undetermined
        If the points leave it open.
    """
    own, other = _normaliser(points), _normaliser(there)
    (x, y), (u, v) = _carried(own, points), _carried(other, there)
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = np.concatenate([
        np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=1),
        np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=1),
    ])  # fmt: skip
    _, spreads, directions = np.linalg.svd(rows)
    if spreads[7] < LEAST_CONDITION * spreads[0]:
        raise Undetermined
    matrix = np.linalg.inv(other) @ directions[8].reshape(3, 3) @ own
    axes = Frame2D.around(there)
    for _ in range(POLISHING_PASSES):
        seen = _carried(matrix, points)
        rows = axes.jacobian(seen, Model.PERSPECTIVE).reshape(-1, Model.PERSPECTIVE)
        step = np.linalg.lstsq(rows, (there - seen).ravel(), rcond=None)[0]
        matrix = axes.matrix(step.tolist(), Model.PERSPECTIVE) @ matrix
    return np.asarray(matrix / matrix[2, 2], np.float64)


def carried(matrix: Matrix, points: Matrix) -> Matrix:
    """(2, N) points through a (3, 3) transformation."""
    return _carried(matrix, points)


def jacobian(matrix: Matrix, point: tuple[float, float]) -> Matrix:
    """(2, 2): what a (3, 3) transformation does to the surroundings of a point."""
    place = matrix @ np.array([*point, 1.0])
    return np.asarray((matrix[:2, :2] - np.outer(place[:2] / place[2], matrix[2, :2])) / place[2])


def _carried(matrix: Matrix, points: Matrix) -> Matrix:
    there = matrix @ np.vstack([points, np.ones(points.shape[1])])
    return np.asarray(there[:2] / there[2])


def _normaliser(points: Matrix) -> Matrix:
    middle = points.mean(axis=1)
    scale = np.sqrt(2.0) / max(float(np.hypot(*(points - middle[:, None])).mean()), 1e-12)
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])
