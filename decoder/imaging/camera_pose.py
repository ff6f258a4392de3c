"""Camera poses: where a camera is and how it is turned, fitted to points of the panel, with uncertainty.

Two coordinate systems are used, both right-handed. The camera's: x right, y down, z forward, as in OpenCV. The panel's,
internally: x right, y down, z into the panel, in inches, so that a camera that is square on is not turned at all.
Externally, the panel's points are as their author gave them, x right, y up or down, and heights grow towards the
camera.

With three points this is Newton's method on six equations, as in thesis 3.1.2; with more it is least squares
(Gauss-Newton, with Levenberg's damping if a step makes matters worse). The unknowns are a small turn and a small shift
of the current pose, in the camera's axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import AGREEMENT_INCHES, LEAST_DAMPING, TRUSTED_SIGMAS
from decoder.panel.lens import Lens

Matrix = NDArray[np.float64]


_MAX_ITERATIONS = 60

PARAMETERS = ("x_inches", "y_inches", "distance_inches", "roll_deg", "pitch_deg", "yaw_deg")


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Camera position and attitude.

    Attributes
    ----------
    rotation
        (3, 3) from the panel's internal axes to the camera's.
    translation_inches
        (3,) the panel's origin in the camera's axes.
    y_up
        Whether the panel's points have y upwards.
    """

    rotation: Matrix
    translation_inches: Matrix
    y_up: bool = False

    @property
    def position_inches(self) -> tuple[float, float, float]:
        """The camera's position: x and y as in the panel's points, and its distance from the panel's plane."""
        x, y, z = (float(value) for value in -self.rotation.T @ self.translation_inches)
        return x, -y if self.y_up else y, -z

    @property
    def attitude_deg(self) -> tuple[float, float, float]:
        """Roll (clockwise, behind the camera), pitch (upwards), yaw (to the right); all 0 for a camera square on.

        The camera is first turned by yaw, then pitched about its own new x axis, then rolled about its optical axis.
        """
        turned = self.rotation.T
        roll = math.atan2(turned[1, 0], turned[1, 1])
        pitch = -math.asin(float(np.clip(turned[1, 2], -1, 1)))
        yaw = math.atan2(turned[0, 2], turned[2, 2])
        return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)

    @property
    def tilt_deg(self) -> float:
        """The angle between the optical axis and the panel's normal: how far from square on."""
        return math.degrees(math.acos(float(np.clip(self.rotation[2, 2], -1, 1))))

    def homography(self, lens: Lens, height_inches: float = 0.0) -> Matrix:
        """(3, 3) from (x, y, 1) in inches, as written, at a height above the panel, to undistorted pixels."""
        flip = -1.0 if self.y_up else 1.0
        right, down, inwards = self.rotation.T
        shifted = self.translation_inches - height_inches * inwards
        return np.asarray(lens.matrix @ np.column_stack([right, flip * down, shifted]))

    def pixels(self, points_inches: Matrix, lens: Lens) -> Matrix:
        """Return where the picture shows points of the panel.

        Parameters
        ----------
        points_inches : (N, 2) on the panel, or (N, 3) with heights towards the camera

        Returns
        -------
        (N, 2) pixels of the picture as taken, including distortion
        """
        seen = self.rotation @ inside(points_inches, y_up=self.y_up).T + self.translation_inches[:, None]
        return lens.distorted(lens.pixels(seen[:2] / seen[2])).T


def inside(points_inches: Matrix, *, y_up: bool) -> Matrix:
    """(N, 3): points as written, (N, 2) or (N, 3), in the panel's internal axes."""
    points = np.asarray(points_inches, np.float64)
    if points.shape[1] == 2:  # noqa: PLR2004 - two coordinates
        points = np.column_stack([points, np.zeros(len(points))])
    return np.asarray(points * [1.0, -1.0 if y_up else 1.0, -1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What a pose is fitted to: (N, 3) points in the panel's internal axes, (N, 2) undistorted pixels, the lens."""

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
        """(2 N, 6): the derivatives of the residuals by a turn (radians) and a shift (inches) of the pose."""
        seen = self.seen(pose)
        x, y, z = seen.T
        nought = np.zeros(len(seen))
        by_place = np.array([[1 / z, nought, -x / z**2], [nought, 1 / z, -y / z**2]]).transpose(2, 0, 1)
        x, y, z = (seen - pose.translation_inches).T  # the turn is about the panel's origin
        by_turn = np.array([[nought, z, -y], [-z, nought, x], [y, -x, nought]]).transpose(2, 0, 1)
        rows = np.concatenate([by_place @ by_turn, by_place], axis=2)
        return np.asarray(rows.reshape(-1, 6) * self.lens.pixels_per_radian)

    def scale(self, pose: Pose) -> Matrix:
        """(6,) factors that make the Jacobian's columns comparable: shifts count as parts of the distance."""
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
    """The result of an iteration: the pose, the number of steps, and whether it converged."""

    pose: Pose
    iterations: int
    settled: bool


def iterate(measured: Measured, start: Pose) -> Iterated:
    """Iterate from one guess until the pose converges."""
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
        if step_inches < AGREEMENT_INCHES / 1000:
            return Iterated(pose, iteration, settled=False)
    return Iterated(pose, _MAX_ITERATIONS, settled=False)


def _agrees(measured: Measured, pose: Pose, step_inches: float) -> bool:
    exact = len(measured.points_inches) == 3  # noqa: PLR2004 - as many equations as unknowns
    return bool((measured.misses_inches(pose).max() if exact else step_inches) < AGREEMENT_INCHES)


def _step(
    measured: Measured, pose: Pose, residuals: Matrix, jacobian: Matrix, damping: float
) -> tuple[Pose | None, float, float]:
    """Take a step: the next pose, how far it moved, and the damping after it; None if no step improves it."""
    scale = measured.scale(pose)
    scaled = jacobian * scale
    error = float(residuals @ residuals)
    while damping < LEAST_DAMPING * 1e15:
        change = _solved(scaled, residuals, damping)
        moved = moved_by(pose, change * scale)
        if np.all(measured.seen(moved)[:, 2] > 0) and _is_no_worse(measured.residuals_px(moved), error):
            softer = damping / 10 if damping > LEAST_DAMPING else 0.0
            return moved, float(np.abs(change).max() * scale[-1]), softer
        damping = max(10 * damping, LEAST_DAMPING)
    return None, 0.0, damping


def _is_no_worse(residuals: Matrix, error: float) -> bool:
    return bool(residuals @ residuals <= error * (1 + 1e-9) + 1e-18)  # rounding at the end does not count as worse


def _solved(jacobian: Matrix, residuals: Matrix, damping: float) -> Matrix:
    """Solve for the Newton step, or a shorter one that turns towards steepest descent as the damping grows."""
    stiff = np.sqrt(damping * np.sum(jacobian**2) / 6) * np.eye(6)
    rows, values = np.vstack([jacobian, stiff]), np.concatenate([residuals, np.zeros(6)])
    return np.asarray(-np.linalg.lstsq(rows, values, rcond=1e-14)[0])


def moved_by(pose: Pose, change: Matrix) -> Pose:
    """Return a pose after a turn (radians, about the panel's origin) and a shift (inches) in the camera's axes."""
    return Pose(cv2.Rodrigues(change[:3])[0] @ pose.rotation, pose.translation_inches + change[3:], pose.y_up)


@dataclass(frozen=True, slots=True, eq=False)
class PoseSolution:
    """One camera position and attitude that fits the reference points.

    Attributes
    ----------
    pose
        Where the camera is.
    covariance
        (6, 6) of `PARAMETERS`, from the points' and the lens's uncertainty; from the residuals, if these are larger.
    iterations
        Steps of the Jacobian iteration.
    residual_inches
        The largest distance on the panel between a reference point and its line of sight.
    rms_px
        Root mean square of the residuals, over x and y.
    condition
        Condition number of the iteration's Jacobian, turns in radians, shifts in parts of the distance.
    fold_sigmas
        How many standard uncertainties of the points it would take for this solution to coincide with another one and
        vanish. Infinite for more than three points.
    """

    pose: Pose
    covariance: Matrix
    iterations: int
    residual_inches: float
    rms_px: float
    condition: float
    fold_sigmas: float

    @property
    def exact(self) -> bool:
        """Whether the points agree as thesis 3.1.2 requires; two solutions merged by noise may not."""
        return self.residual_inches < AGREEMENT_INCHES

    @property
    def trusted(self) -> bool:
        """Whether this is one place, and not between two that coincide within the uncertainty."""
        return bool(self.fold_sigmas >= TRUSTED_SIGMAS)

    @property
    def values(self) -> Matrix:
        """(6,) the `PARAMETERS`."""
        return parameters(self.pose)

    @property
    def sigmas(self) -> Matrix:
        """(6,) standard uncertainties of the `PARAMETERS`."""
        return np.sqrt(np.diag(self.covariance))


def parameters(pose: Pose) -> Matrix:
    """(6,) the `PARAMETERS` of a pose."""
    return np.array([*pose.position_inches, *pose.attitude_deg])


def difference_of(one: Pose, other: Pose) -> Matrix:
    """(6,) by how much the `PARAMETERS` of one pose exceed another's, angles the short way round."""
    difference = parameters(one) - parameters(other)
    difference[3:] = (difference[3:] + 180) % 360 - 180
    return np.asarray(difference)


def solution_of(measured: Measured, iterated: Iterated, sigma_px: float) -> PoseSolution:
    """Return the result of an iteration, with its uncertainty if points are uncertain by sigma_px in x and y."""
    pose = iterated.pose
    seen, residuals = measured.seen(pose), measured.residuals_px(pose)
    scale = measured.scale(pose)
    left, singular, right = np.linalg.svd(measured.jacobian(pose) * scale, full_matrices=False)
    noise_px = sigma_px * np.sqrt(max(1.0, _excess(residuals, sigma_px)))
    spreads, fold_sigmas = noise_px / singular, np.inf
    if residuals.size == len(PARAMETERS):
        bend = abs(float(left[:, -1] @ _bend(measured, pose, right[-1] * scale)))
        slope = float(singular[-1])
        fold_sigmas = slope**2 / (2 * bend * noise_px)
        if fold_sigmas < TRUSTED_SIGMAS:  # include the extent of both solutions
            spreads[-1] = (slope + np.sqrt(slope**2 + 2 * bend * noise_px)) / bend
    by_lens = (
        right.T @ (left.T @ (seen[:, :2] / seen[:, 2:]).ravel() / singular) * measured.lens.pixels_per_radian_sigma
    )
    inside_covariance = (right.T * spreads**2) @ right + np.outer(by_lens, by_lens)
    outside = _outside(pose, scale)
    return PoseSolution(
        pose=pose,
        covariance=outside @ inside_covariance @ outside.T,
        iterations=iterated.iterations,
        residual_inches=float(measured.misses_inches(pose).max()),
        rms_px=float(np.sqrt(np.mean(residuals**2))),
        condition=float(singular[0] / singular[-1]),
        fold_sigmas=float(fold_sigmas),
    )


def _bend(measured: Measured, pose: Pose, direction: Matrix) -> Matrix:
    """(2 N,) second derivative of the residuals along a direction of the iteration's unknowns."""
    step = 1e-4
    ends = (measured.residuals_px(moved_by(pose, sign * step * direction)) for sign in (-1, 1))
    return np.asarray((sum(ends) - 2 * measured.residuals_px(pose)) / step**2)


def _excess(residuals_px: Matrix, sigma_px: float) -> float:
    """Return the ratio of the residuals' variance to what the points' uncertainty explains; 1 if it may be chance."""
    freedom = residuals_px.size - len(PARAMETERS)
    if freedom <= 0:
        return 1.0
    ratio = float(residuals_px @ residuals_px) / (freedom * sigma_px**2)
    by_chance = (1 - 2 / (9 * freedom) + 2.33 * np.sqrt(2 / (9 * freedom))) ** 3  # chi-square, 99 % (Wilson-Hilferty)
    return ratio if ratio > by_chance else 1.0


def variance_px2(best: PoseSolution, measured: Measured, sigma_px: float) -> float:
    """Estimate the points' variance in x and in y: as given, or from the residuals if larger."""
    return float(sigma_px**2 * max(1.0, _excess(measured.residuals_px(best.pose), sigma_px)))


def _outside(pose: Pose, scale: Matrix) -> Matrix:
    """(6, 6): derivatives of the `PARAMETERS` by the iteration's unknowns, by central differences."""
    step = 1e-6
    columns = []
    for unknown in range(len(PARAMETERS)):
        change = np.zeros(len(PARAMETERS))
        change[unknown] = step * scale[unknown]
        columns.append(difference_of(moved_by(pose, change), moved_by(pose, -change)) / (2 * step))
    return np.stack(columns, axis=1)
