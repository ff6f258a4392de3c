"""The Jacobian iteration: from a guess of the camera's place to the place where model and measurement agree.

With three points this is Newton's method on six equations, as in thesis 3.1.2; with more it is least squares (Gauss,
with Levenberg's damping when a step makes matters worse). Unknown are a small turn and a small shift, in the camera's
axes, of the pose so far.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.calibration.view import Matrix, Pose, rotation_by
from decoder.lens import Lens

AGREEMENT_INCHES = 1e-7
"""When the iteration ends (thesis 3.1.2): three points agree to it, with more the pose moves by less."""

_MAX_ITERATIONS = 60
_MAX_DAMPING = 1e9
_STANDSTILL_INCHES = 1e-10
_LEAST_DAMPING = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What a pose is held against: (N, 3) points in the panel's inner axes, (N, 2) undistorted pixels, the lens."""

    points_inches: Matrix
    points_px: Matrix
    lens: Lens

    def seen(self, pose: Pose) -> Matrix:
        """(N, 3) the points in the camera's axes."""
        return np.asarray(self.points_inches @ pose.rotation.T + pose.translation_inches)

    def residuals_px(self, pose: Pose) -> Matrix:
        """(2 N,) modelled minus measured pixels, x and y of each point in turn."""
        seen = self.seen(pose)
        return np.asarray((self.lens.pixels((seen[:, :2] / seen[:, 2:]).T).T - self.points_px).ravel())

    def jacobian(self, pose: Pose) -> Matrix:
        """(2 N, 6): how the residuals grow with a turn (radians) and a shift (inches) of the pose."""
        seen = self.seen(pose)
        x, y, z = seen.T
        nought = np.zeros(len(seen))
        by_place = np.array([[1 / z, nought, -x / z**2], [nought, 1 / z, -y / z**2]]).transpose(2, 0, 1)
        x, y, z = (seen - pose.translation_inches).T  # the turn is about the panel's origin
        by_turn = np.array([[nought, z, -y], [-z, nought, x], [y, -x, nought]]).transpose(2, 0, 1)
        rows = np.concatenate([by_place @ by_turn, by_place], axis=2)
        return np.asarray(rows.reshape(-1, 6) * self.lens.pixels_per_radian)

    def scale(self, pose: Pose) -> Matrix:
        """(6,) what makes the Jacobian's columns alike: shifts count in parts of the distance."""
        distance = float(self.seen(pose)[:, 2].mean())
        return np.array([1.0, 1, 1, distance, distance, distance])

    def misses_inches(self, pose: Pose) -> Matrix:
        """(N,) how far from each point its measured line of sight meets the panel."""
        centre = -pose.rotation.T @ pose.translation_inches
        sights = (
            np.column_stack([self.lens.normalised(self.points_px.T).T, np.ones(len(self.points_px))]) @ pose.rotation
        )
        reach = (self.points_inches[:, 2] - centre[2]) / sights[:, 2]
        met = centre + reach[:, None] * sights
        return np.asarray(np.linalg.norm(met - self.points_inches, axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Iterated:
    """Where an iteration has led: the pose, after how many steps, and whether it has settled there."""

    pose: Pose
    iterations: int
    settled: bool


def iterate(measured: Measured, start: Pose) -> Iterated:
    """The Jacobian iteration from one guess."""
    pose, damping = start, 0.0
    residuals = measured.residuals_px(pose)
    for iteration in range(1, _MAX_ITERATIONS + 1):
        jacobian = measured.jacobian(pose)
        moved, step_inches, damping = _step(measured, pose, residuals, jacobian, damping)
        if moved is None:
            return Iterated(pose, iteration, _agrees(measured, pose, 0.0))
        pose, residuals = moved, measured.residuals_px(moved)
        if _agrees(measured, pose, step_inches):
            return Iterated(pose, iteration, settled=True)
        if step_inches < _STANDSTILL_INCHES:
            return Iterated(pose, iteration, settled=False)
    return Iterated(pose, _MAX_ITERATIONS, settled=False)


def _agrees(measured: Measured, pose: Pose, step_inches: float) -> bool:
    exact = len(measured.points_inches) == 3  # noqa: PLR2004 - as many equations as unknowns
    return bool((measured.misses_inches(pose).max() if exact else step_inches) < AGREEMENT_INCHES)


def _step(
    measured: Measured, pose: Pose, residuals: Matrix, jacobian: Matrix, damping: float
) -> tuple[Pose | None, float, float]:
    """The next pose, by how much it moved, and the damping for the step after; None if no step makes it better."""
    scale = measured.scale(pose)
    scaled = jacobian * scale
    error = float(residuals @ residuals)
    while damping < _MAX_DAMPING:
        change = _solved(scaled, residuals, damping)
        moved = moved_by(pose, change * scale)
        if np.all(measured.seen(moved)[:, 2] > 0) and _is_no_worse(measured.residuals_px(moved), error):
            softer = damping / 10 if damping > _LEAST_DAMPING else 0.0
            return moved, float(np.abs(change).max() * scale[-1]), softer
        damping = max(10 * damping, _LEAST_DAMPING)
    return None, 0.0, damping


def _is_no_worse(residuals: Matrix, error: float) -> bool:
    return bool(residuals @ residuals <= error * (1 + 1e-9) + 1e-18)  # rounding at the end is no step backwards


def _solved(jacobian: Matrix, residuals: Matrix, damping: float) -> Matrix:
    """The Newton step, or a shorter one that turns towards steepest descent as the damping grows."""
    stiff = np.sqrt(damping * np.sum(jacobian**2) / 6) * np.eye(6)
    rows, values = np.vstack([jacobian, stiff]), np.concatenate([residuals, np.zeros(6)])
    return np.asarray(-np.linalg.lstsq(rows, values, rcond=1e-14)[0])


def moved_by(pose: Pose, change: Matrix) -> Pose:
    """A pose after a turn (radians, about the panel's origin) and a shift (inches) in the camera's axes, (6,)."""
    return Pose(rotation_by(change[:3]) @ pose.rotation, pose.translation_inches + change[3:], pose.y_up)
