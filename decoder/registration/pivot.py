"""Where needles turn: a gauge's pivot as they tell it, and how uncertain that is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from decoder.panel.arrays import Floats
from decoder.registration.thresholds import CERTAIN_SIGMAS, SIGNIFICANT_SIGMAS

# What is thought of a panel's pivot before any frame has been seen, pixels.
PRIOR_PX = 0.5
# A needle stands a few millimetres above a dial that lies some centimetres from the anchors' plane.
PRIOR_LIFT = 0.2
# A direction of which less is told, beside the other, is not told at all.
LEAST_TOLD = 1e-9


def across(angles_deg: Floats) -> Floats:
    """(N, 2): the unit vectors across needles at angles, in the direction in which angles grow."""
    angles = np.radians(angles_deg)
    return np.stack([-np.sin(angles), np.cos(angles)], axis=1)


@dataclass(frozen=True, slots=True)
class Pivot:
    """A gauge's pivot as its needles tell it, relative to where the gauge was unwrapped.

    Attributes
    ----------
    offset_px
        (x, y).
    covariance_px2
        (2, 2) of the offset.
    lift, lift_sigma
        How far the needle goes beyond its dial, for each pixel that the dial moves against the anchors: it stands
        nearer to the camera; and how uncertain that is.
    scatter_px2, tilts
        The variance of the needles' tilts beyond their own noise, which may come out below nothing, and how many
        tilts tell it: by so much the dial is not where it was unwrapped, another way in each frame.
    """

    offset_px: tuple[float, float]
    covariance_px2: Floats
    lift: float = 0.0
    lift_sigma: float = PRIOR_LIFT
    scatter_px2: float = 0.0
    tilts: int = 0

    @property
    def is_certain(self) -> bool:
        """Whether the needles turn elsewhere for all that is known.

        Beyond doubt would be too much: a needle that is learned around a wrong pivot shows a part of its offset only.
        """
        offset = np.array(self.offset_px)
        return float(offset @ np.linalg.solve(self.covariance_px2, offset)) > CERTAIN_SIGMAS**2

    @property
    def sigma_px(self) -> float:
        """How uncertain the offset is, to each side."""
        return math.sqrt(float(np.trace(self.covariance_px2)) / 2)

    @property
    def is_lifted(self) -> bool:
        """Whether the needle goes another way than its dial beyond doubt."""
        return abs(self.lift) > SIGNIFICANT_SIGMAS * self.lift_sigma

    @property
    def shrunk_lift(self) -> float:
        """The lift as far as needles tell it."""
        return self.lift**3 / (self.lift**2 + self.lift_sigma**2)

    @property
    def shrunk_px(self) -> Floats:
        """(2,): the offset as far as needles tell it."""
        told: Floats = self.shrinkage @ np.array(self.offset_px)
        return told

    @property
    def shrinkage(self) -> Floats:
        """(2, 2): how much of what is left needles tell, the less the more they doubt it in some direction.

        It is what to think of an offset that is about as long as it seems and may lie in any direction (a ridge).
        """
        size_px2 = float(np.square(self.offset_px).sum())
        part: Floats = size_px2 * np.linalg.inv(self.covariance_px2 + size_px2 * np.eye(2))
        return part

    def settled(self, first_px: tuple[float, float], moved_px: tuple[float, float]) -> Pivot:
        """Scale the covariance to what it is after the pivot was moved in steps, of which `first_px` was the first.

        A step falls short where the needle that was learned around the old pivot took in a part of the tilts. All of
        them together, `moved_px` and what is left, go so many times as far as the first, and so do its errors.
        """
        first, whole = math.hypot(*first_px), math.dist(moved_px, [-left for left in self.offset_px])
        if first == 0.0 or whole <= first:
            return self
        return replace(self, covariance_px2=self.covariance_px2 * (whole / first) ** 2)

    def unsettled(self) -> Pivot:
        """Add what is left of the offset to the covariance: the pivot was looked for, and not found."""
        return self.beside(np.array(self.offset_px))

    def doubted(self) -> Pivot:
        """Doubt what needles told by as much as it is: few places told it, and what spoils one of them would move it.

        That is of what they told alone, without the prior: doubting both as one leaves a pull with nothing behind it.
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
        """Add to the covariance that it may as well lie by so much, (2,), to one side or the other."""
        return replace(self, covariance_px2=self.covariance_px2 + np.outer(offset_px, offset_px))

    def blurred(self, sigma_px: float) -> Pivot:
        """Add so much uncertainty in every direction."""
        return replace(self, covariance_px2=self.covariance_px2 + sigma_px**2 * np.eye(2))

    def sigma_deg(self, angles_deg: Floats, zero_deg: float, radius_px: float) -> Floats:
        """Return what a pivot that is still not quite right may add to readings, as a standard uncertainty.

        Parameters
        ----------
        angles_deg
            (N,): of the readings.
        zero_deg
            The angle at which the needle's zero was set: there the pivot does no harm.
        radius_px
            The needle's mean radius.
        """
        lever = across(angles_deg) - across(np.array([zero_deg]))
        variance = np.einsum("ni,ij,nj->n", lever, self.covariance_px2, lever)
        sigma: Floats = np.degrees(np.sqrt(np.maximum(variance, 0.0)) / radius_px)
        return sigma


UNKNOWN = Pivot((0.0, 0.0), PRIOR_PX**2 * np.eye(2))
