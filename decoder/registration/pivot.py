"""A gauge's pivot as estimated from its needles, with its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from decoder.panel.arrays import Floats
from decoder.registration.thresholds import CERTAIN_SIGMAS, SIGNIFICANT_SIGMAS

# Prior standard deviation of a pivot's offset, before any frame has been seen, pixels.
PRIOR_PX = 0.5
# Prior standard deviation of the lift: needles stand a few millimetres above their dial, and dials lie a few
# centimetres from the anchors' plane.
PRIOR_LIFT = 0.2
# Relative cutoff: a direction with less information than this part of the other's counts as having none.
LEAST_TOLD = 1e-9


def across(angles_deg: Floats) -> Floats:
    """(N, 2): unit vectors perpendicular to needles at these angles, in the direction of increasing angle."""
    angles = np.radians(angles_deg)
    return np.stack([-np.sin(angles), np.cos(angles)], axis=1)


@dataclass(frozen=True, slots=True)
class Pivot:
    """A gauge's pivot as estimated from its needles, relative to the point the gauge was unwrapped around.

    Attributes
    ----------
    offset_px
        (x, y).
    covariance_px2
        (2, 2), of the offset.
    lift, lift_sigma
        How far the needle moves beyond its dial for each pixel that the dial moves relative to the anchors, because it
        stands nearer to the camera; and the uncertainty of that.
    scatter_px2, tilts
        The variance of the needles' tilts in excess of their own noise (an estimate, so it may be negative), and how
        many tilts it comes from. It measures how far, differently in each frame, the dial is from where it was
        unwrapped.
    """

    offset_px: tuple[float, float]
    covariance_px2: Floats
    lift: float = 0.0
    lift_sigma: float = PRIOR_LIFT
    scatter_px2: float = 0.0
    tilts: int = 0

    @property
    def is_certain(self) -> bool:
        """Whether the offset is significant enough to follow.

        A stricter test would miss real offsets: a needle learned around a wrong pivot shows only part of its offset.
        """
        offset = np.array(self.offset_px)
        return float(offset @ np.linalg.solve(self.covariance_px2, offset)) > CERTAIN_SIGMAS**2

    @property
    def sigma_px(self) -> float:
        """The standard deviation of the offset per axis."""
        return math.sqrt(float(np.trace(self.covariance_px2)) / 2)

    @property
    def is_lifted(self) -> bool:
        """Whether the lift differs from zero significantly."""
        return abs(self.lift) > SIGNIFICANT_SIGMAS * self.lift_sigma

    @property
    def shrunk_lift(self) -> float:
        """The lift, shrunk towards zero by its uncertainty."""
        return self.lift**3 / (self.lift**2 + self.lift_sigma**2)

    @property
    def shrunk_px(self) -> Floats:
        """(2,): the offset, shrunk towards zero by its uncertainty."""
        told: Floats = self.shrinkage @ np.array(self.offset_px)
        return told

    @property
    def shrinkage(self) -> Floats:
        """(2, 2): the matrix that shrinks the offset, most in the directions in which it is least certain.

        It is ridge regression for an offset of about the length measured that may point in any direction.
        """
        size_px2 = float(np.square(self.offset_px).sum())
        part: Floats = size_px2 * np.linalg.inv(self.covariance_px2 + size_px2 * np.eye(2))
        return part

    def settled(self, first_px: tuple[float, float], moved_px: tuple[float, float]) -> Pivot:
        """Scale the covariance for a pivot that was moved in several steps, of which `first_px` was the first.

        Each step falls short, because the needle learned around the old pivot absorbed part of the tilts. The whole
        way, `moved_px` plus the remaining offset, is longer than the first step by some factor; errors grow by it too.
        """
        first, whole = math.hypot(*first_px), math.dist(moved_px, [-left for left in self.offset_px])
        if first == 0.0 or whole <= first:
            return self
        return replace(self, covariance_px2=self.covariance_px2 * (whole / first) ** 2)

    def unsettled(self) -> Pivot:
        """Add the remaining offset to the covariance, for a pivot that was searched for without converging."""
        return self.beside(np.array(self.offset_px))

    def doubted(self) -> Pivot:
        """Inflate what the needles tell by the offset they indicate: with few positions, one bad one could cause it.

        Only the needles' own information is inflated. Inflating the prior as well would leave a pull without
        information behind it.
        """
        prior = np.eye(2) / PRIOR_PX**2
        inverse = np.linalg.inv(self.covariance_px2)
        pull = inverse @ np.array(self.offset_px)
        information = inverse - prior
        share = 1.0 / (1.0 + float(pull @ np.linalg.pinv(information, LEAST_TOLD, hermitian=True) @ pull))
        covariance = np.linalg.inv(information - share * np.outer(pull, pull) + prior)
        x, y = (covariance @ (share * pull)).tolist()
        return replace(self, offset_px=(x, y), covariance_px2=covariance)

    def beside(self, offset_px: Floats) -> Pivot:
        """Add to the covariance a possible offset (2,) to either side."""
        return replace(self, covariance_px2=self.covariance_px2 + np.outer(offset_px, offset_px))

    def blurred(self, sigma_px: float) -> Pivot:
        """Add an uncertainty of `sigma_px` in every direction."""
        return replace(self, covariance_px2=self.covariance_px2 + sigma_px**2 * np.eye(2))

    def sigma_deg(self, angles_deg: Floats, zero_deg: float, radius_px: float) -> Floats:
        """Return the standard uncertainty of readings that is due to the remaining error of the pivot.

        Parameters
        ----------
        angles_deg
            (N,): of the readings.
        zero_deg
            The angle at which the needle's zero was set; there an error of the pivot has no effect.
        radius_px
            The needle's mean radius.
        """
        lever = across(angles_deg) - across(np.array([zero_deg]))
        variance = np.einsum("ni,ij,nj->n", lever, self.covariance_px2, lever)
        sigma: Floats = np.degrees(np.sqrt(np.maximum(variance, 0.0)) / radius_px)
        return sigma


UNKNOWN = Pivot((0.0, 0.0), PRIOR_PX**2 * np.eye(2))
