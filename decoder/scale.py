"""The scale: from the angle of a needle to the value it points at, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats
from decoder.scale_marks import FULL_CIRCLE_DEG


@dataclass(frozen=True, slots=True)
class Scale:
    """Tick marks of one gauge: angles in degrees rising, values in its unit rising or falling with them.

    Between marks the value is interpolated linearly; beyond the outermost it is extrapolated along the last two
    (thesis 3.2.2). With `wraps`, the value of a full turn, the scale goes all the way round: behind its last mark
    comes the first again, a turn on, and values lie in [0, wraps).
    """

    angles_deg: Floats
    values: Floats
    wraps: float | None = None

    @classmethod
    def of(cls, marks: Sequence[tuple[float, float]], wraps: float | None = None) -> Scale:
        """The scale of (angle, value) marks, sorted by angle."""
        angles_deg, values = np.array(marks, np.float64).T
        if wraps is not None and angles_deg[-1] - angles_deg[0] < FULL_CIRCLE_DEG:
            angles_deg = np.append(angles_deg, angles_deg[0] + FULL_CIRCLE_DEG)
            values = np.append(values, values[0] + math.copysign(wraps, values[-1] - values[0]))
        return cls(angles_deg, values, wraps)

    def values_at(self, angles_deg: Floats) -> Floats:
        """The values at angles; NaN stays NaN."""
        angles_deg = self._in_turn(angles_deg)
        part = self._part(self.angles_deg, angles_deg)
        values: Floats = self.values[part] + (angles_deg - self.angles_deg[part]) * self._slopes[part]
        return values if self.wraps is None else in_turn(values, self.wraps)

    def slopes_at(self, angles_deg: Floats) -> Floats:
        """Units per degree at angles; negative where values fall clockwise."""
        slopes: Floats = self._slopes[self._part(self.angles_deg, self._in_turn(angles_deg))]
        return slopes

    def angles_of(self, values: Floats) -> Floats:
        """The angles at which the needle shows values."""
        sign = 1.0 if self.values[-1] > self.values[0] else -1.0
        if self.wraps is not None:
            values = self.values[0] + sign * in_turn(sign * (values - self.values[0]), self.wraps)
        part = self._part(sign * self.values, sign * np.asarray(values, np.float64))
        angles_deg: Floats = self.angles_deg[part] + (values - self.values[part]) / self._slopes[part]
        return angles_deg

    def _in_turn(self, angles_deg: Floats) -> Floats:
        if self.wraps is None:
            return angles_deg
        within: Floats = self.angles_deg[0] + in_turn(angles_deg - self.angles_deg[0], FULL_CIRCLE_DEG)
        return within

    @property
    def _slopes(self) -> Floats:
        slopes: Floats = np.diff(self.values) / np.diff(self.angles_deg)
        return slopes

    @staticmethod
    def _part(edges: Floats, places: Floats) -> NDArray[np.intp]:
        return np.clip(np.searchsorted(edges, places) - 1, 0, len(edges) - 2)


def in_turn(values: Floats, turn: float, lowest: float = 0.0) -> Floats:
    """Values brought into [lowest, lowest + turn) by whole turns."""
    inside = np.mod(values - lowest, turn)
    below: Floats = np.where(inside == turn, 0.0, inside)  # a remainder of minus nothing is rounded up to a turn
    return below + lowest


def shortest(differences: Floats, turn: float | None) -> Floats:
    """Differences the short way round, in [-turn / 2, turn / 2]; as they are where nothing wraps."""
    return differences if turn is None else differences - turn * np.round(differences / turn)
