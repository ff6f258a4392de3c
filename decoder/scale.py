"""The scale: from the angle of a needle to the value it points at, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats


@dataclass(frozen=True, slots=True)
class Scale:
    """Tick marks of one gauge: angles in degrees rising, values in its unit rising or falling with them.

    Between marks the value is interpolated linearly; beyond the outermost it is extrapolated along the last two
    (thesis 3.2.2).
    """

    angles_deg: Floats
    values: Floats

    @classmethod
    def of(cls, marks: Sequence[tuple[float, float]]) -> Scale:
        """The scale of (angle, value) marks, sorted by angle."""
        angles_deg, values = np.array(marks, np.float64).T
        return cls(angles_deg, values)

    def values_at(self, angles_deg: Floats) -> Floats:
        """The values at angles; NaN stays NaN."""
        part = self._part(self.angles_deg, angles_deg)
        values: Floats = self.values[part] + (angles_deg - self.angles_deg[part]) * self._slopes[part]
        return values

    def slopes_at(self, angles_deg: Floats) -> Floats:
        """Units per degree at angles; negative where values fall clockwise."""
        slopes: Floats = self._slopes[self._part(self.angles_deg, angles_deg)]
        return slopes

    def angles_of(self, values: Floats) -> Floats:
        """The angles at which the needle shows values."""
        sign = 1.0 if self.values[-1] > self.values[0] else -1.0
        part = self._part(sign * self.values, sign * np.asarray(values, np.float64))
        angles_deg: Floats = self.angles_deg[part] + (values - self.values[part]) / self._slopes[part]
        return angles_deg

    @property
    def _slopes(self) -> Floats:
        slopes: Floats = np.diff(self.values) / np.diff(self.angles_deg)
        return slopes

    @staticmethod
    def _part(edges: Floats, places: Floats) -> NDArray[np.intp]:
        return np.clip(np.searchsorted(edges, places) - 1, 0, len(edges) - 2)
