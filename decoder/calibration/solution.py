"""One camera position and attitude that fits, and how uncertain it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.calibration.iteration import AGREEMENT_INCHES, Iterated, Measured, moved_by
from decoder.calibration.view import Matrix, Pose

PARAMETERS = ("x_inches", "y_inches", "distance_inches", "roll_deg", "pitch_deg", "yaw_deg")
TRUSTED_SIGMAS = 4.0
"""Two solutions that more than this lies between are told apart."""


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
        How many standard uncertainties of the points would make this solution fall together with another one, where
        it ceases to be one. Infinite for more than three points.
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
        """Whether the points agree to what thesis 3.1.2 asks for; what noise leaves of two solutions may not."""
        return self.residual_inches < AGREEMENT_INCHES

    @property
    def trusted(self) -> bool:
        """Whether this is one place, and not somewhere between two that fall together within the uncertainty."""
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
    """What an iteration has led to, with its uncertainty if each point is uncertain by sigma_px in x and in y."""
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
        if fold_sigmas < TRUSTED_SIGMAS:  # as far as both solutions together reach
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
    """How much larger the residuals' variance is than the points' uncertainty explains; 1 where chance may do it."""
    freedom = residuals_px.size - len(PARAMETERS)
    if freedom <= 0:
        return 1.0
    ratio = float(residuals_px @ residuals_px) / (freedom * sigma_px**2)
    by_chance = (1 - 2 / (9 * freedom) + 2.33 * np.sqrt(2 / (9 * freedom))) ** 3  # chi-square, 99 % (Wilson-Hilferty)
    return ratio if ratio > by_chance else 1.0


def variance_px2(best: PoseSolution, measured: Measured, sigma_px: float) -> float:
    """The points' variance in x and in y: as it was said, or as the best solution's residuals show it if larger."""
    return float(sigma_px**2 * max(1.0, _excess(measured.residuals_px(best.pose), sigma_px)))


def _outside(pose: Pose, scale: Matrix) -> Matrix:
    """(6, 6): how the `PARAMETERS` change with the iteration's unknowns, by central differences."""
    step = 1e-6
    columns = []
    for unknown in range(len(PARAMETERS)):
        change = np.zeros(len(PARAMETERS))
        change[unknown] = step * scale[unknown]
        columns.append(difference_of(moved_by(pose, change), moved_by(pose, -change)) / (2 * step))
    return np.stack(columns, axis=1)
