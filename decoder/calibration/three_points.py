"""Every place from which three known points look as they do, roughly: where the Jacobian iteration starts.

Three points have up to four such places. The thesis starts from a guess and finds one; here Grunert's quartic gives a
guess for each. Source: Haralick et al., "Review and analysis of solutions of the three point perspective pose
estimation problem", IJCV 13 (1994).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from decoder.calibration.view import Matrix, Pose

_NEARLY_REAL = 0.3  # imaginary part of a root, relative; a double root that noise has split is still a guess
_FITS = 0.05  # by how much, relative, a guess may miss the third side of the triangle


def guesses(points_inches: Matrix, normalised: Matrix) -> list[Pose]:
    """Poses that show three points about where they are.

    Parameters
    ----------
    points_inches : (3, 3) in the panel's inner axes
    normalised : (3, 2) where they are seen, in undistorted normalised coordinates

    Returns
    -------
    list of Pose, at most eight, some of them near each other; empty if there is no place at all
    """
    sights = np.column_stack([normalised, np.ones(3)])
    sights /= np.linalg.norm(sights, axis=1)[:, None]
    return [moved(points_inches, distances[:, None] * sights) for distances in _distances(points_inches, sights)]


def moved(points: Matrix, onto: Matrix) -> Pose:
    """The rigid movement that brings (N, 3) points onto others, by least squares (Kabsch)."""
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
        if third <= 0 or abs(root.imag) > _NEARLY_REAL * abs(root):
            continue
        first = np.sqrt(b / (1 + third**2 - 2 * third * cos_b))
        second = cos_c + sign * np.sqrt(max(cos_c**2 - 1 + c / first**2, 0.0))
        side = first**2 * (second**2 + third**2 - 2 * second * third * cos_a)
        if second > 0 and abs(side / a - 1) < _FITS:
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
