"""A reading: one needle in one frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from decoder.imaging.alignment import Alignment, Point
from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS
from decoder.panel.scale import FULL_CIRCLE_DEG

# Standard deviation of a uniform distribution of width 1, for what may be anywhere.
ANYWHERE = 12**-0.5


class Status(StrEnum):
    """How a value came about; there is no value without one."""

    READ = "read"
    """The whole needle matched."""
    EDGE = "edge"
    """Another needle covers it in part, and what is left matched; or its gauge is drawn too carelessly."""
    HIDDEN = "hidden"
    """Another needle covers it wholly; it takes that needle's place."""
    INTERPOLATED = "interpolated"
    """It could not be read; its value lies on the line between the nearest frames in which it could."""
    MISSING = "missing"
    """There is no value."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One needle in one frame, before time is considered.

    Attributes
    ----------
    status
        READ, EDGE, HIDDEN, or MISSING where the score stays below `SCORE_THRESHOLD`.
    angle_deg, sigma_deg
        Where the needle points and the standard uncertainty of that; of the best match even if it is MISSING.
    score
        NCC of the match, in [-1, 1].
    """

    status: Status
    angle_deg: float
    sigma_deg: float
    score: float

    @property
    def is_seen(self) -> bool:
        """Whether something of the needle was seen; one that is hidden may also be one that was not found."""
        return self.status in (Status.READ, Status.EDGE)

    def is_at(self, angle_deg: float | None) -> bool:
        """Whether it cannot be told from this angle."""
        if angle_deg is None:
            return False
        off_deg = math.remainder(self.angle_deg - angle_deg, FULL_CIRCLE_DEG)
        return abs(off_deg) <= BEYOND_CHANCE_SPREADS * self.sigma_deg

    def in_place_within(self, sigma_deg: float) -> Reading:
        """Return the reading with the uncertainty `sigma_deg` of its dial's position added."""
        return Reading(self.status, self.angle_deg, math.hypot(self.sigma_deg, sigma_deg), self.score)


@dataclass(frozen=True, slots=True)
class FrameReadings:
    """One frame's alignment, and its readings by needle.

    `dial_shifts_px` are how far the needles of dials that were located one by one lie from where the alignment puts
    them, (x, y) in the panel picture's pixels, in the panel's order; empty where all lie where it says.
    """

    alignment: Alignment
    readings: Mapping[str, Reading]
    dial_shifts_px: Sequence[Point] = ()


Readings = list[dict[str, Reading]]
"""By frame the readings by name."""
