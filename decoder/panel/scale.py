"""Scales: the marks that a panel gives, and what an angle means between them.

A part of the panel format, see `decoder.panel.panel`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from decoder.panel.arrays import Degrees, Floats, Number
from decoder.panel.thresholds import LEAST_DEG, LEAST_VALUE

FULL_CIRCLE_DEG = 360.0

MOST_POINTS = 1000  # that are marked on one thing: more than there are ticks on any dial

Marks = Annotated[tuple[tuple[Degrees, Number], ...], Field(max_length=MOST_POINTS)]


def monotone(scale: Marks) -> Marks:
    """Sort marks by angle; ValueError where there are too few, or the values turn round along the dial."""
    if len(scale) < 2:  # noqa: PLR2004 - a line needs two points
        raise ValueError("needs at least two [angle, value] marks")
    marks = sorted(scale)
    turns = {after[0] > before[0] for before, after in pairwise(marks)}
    rises = [after[1] - before[1] for before, after in pairwise(marks)]
    steps = {(rise > 0) - (rise < 0) for rise in rises}
    if turns != {True} or steps not in ({1}, {-1}):
        raise ValueError(
            "must be monotone: each mark at another angle, values only rising or only falling along the dial"
        )
    if any(
        after[0] - before[0] < LEAST_DEG or abs(after[1] - before[1]) < LEAST_VALUE for before, after in pairwise(marks)
    ):
        raise ValueError(f"has two marks less than {LEAST_DEG:g} degrees or {LEAST_VALUE:g} apart; remove one")
    return tuple(marks)


def marks_at(scale: Marks, true_deg: Callable[[float], float]) -> Marks:
    """Exchange the angles of marks; their values stay."""
    return tuple((true_deg(angle_deg), value) for angle_deg, value in scale)


def turned(scale: Sequence[Sequence[float]], turn_deg: float) -> list[list[float]]:
    """Turn the marks of a draft's scale."""
    return [[round(angle_deg + turn_deg, 4), value] for angle_deg, value in scale]


def check_turn(scale: Marks, wraps: float) -> None:
    """ValueError unless the marks lie in one turn, and leave something of its value for the way back to the first."""
    (first_deg, first), (last_deg, last) = scale[0], scale[-1]
    if last_deg - first_deg == FULL_CIRCLE_DEG and abs(last - first) == wraps:
        return
    if last_deg - first_deg >= FULL_CIRCLE_DEG or abs(last - first) >= wraps:
        raise ValueError(
            f"`scale` does not fit `wraps: {wraps:g}`: its marks must lie within one turn and one turn's value"
        )


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
        """Make a scale of (angle, value) marks, sorted by angle."""
        angles_deg, values = np.array(marks, np.float64).T
        if wraps is not None and angles_deg[-1] - angles_deg[0] < FULL_CIRCLE_DEG:
            angles_deg = np.append(angles_deg, angles_deg[0] + FULL_CIRCLE_DEG)
            values = np.append(values, values[0] + math.copysign(wraps, values[-1] - values[0]))
        return cls(angles_deg, values, wraps)

    def values_at(self, angles_deg: Floats) -> Floats:
        """Read the values at angles; NaN stays NaN."""
        angles_deg = self._in_turn(angles_deg)
        part = self._part(self.angles_deg, angles_deg)
        values: Floats = self.values[part] + (angles_deg - self.angles_deg[part]) * self._slopes[part]
        return values if self.wraps is None else in_turn(values, self.wraps)

    def slopes_at(self, angles_deg: Floats) -> Floats:
        """Units per degree at angles; negative where values fall clockwise."""
        slopes: Floats = self._slopes[self._part(self.angles_deg, self._in_turn(angles_deg))]
        return slopes

    def angles_of(self, values: Floats) -> Floats:
        """Compute the angles at which the needle shows values."""
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


@dataclass(frozen=True, slots=True)
class Quantity:
    """What one column of values means.

    Attributes
    ----------
    name, gauge, unit
        Of the column, of the gauge it comes from, and of its values.
    marks
        (angle, value) each, sorted by angle.
    wraps
        What a full turn is worth where the values begin again after it: they lie in [lowest, lowest + wraps).
    covered_by
        The needle that turns above this one.
    max_rate
        How fast the value can change, in its unit a second, if that is known.
    limits
        The lowest and the highest value that there is, where marks do not tell.
    """

    name: str
    gauge: str
    unit: str
    marks: Marks
    wraps: float | None
    covered_by: str | None
    max_rate: float | None
    lowest: float = 0.0
    limits: tuple[float, float] | None = None

    @property
    def full_scale(self) -> float:
        """The span of values between the outermost marks, or of a full turn."""
        low, high = self.range
        return high - low

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest value of the scale."""
        if self.wraps is not None:
            return self.lowest, self.lowest + self.wraps
        if self.limits is not None:
            return self.limits
        values = [value for _, value in self.marks]
        return min(values), max(values)


@dataclass(frozen=True, slots=True)
class Combination:
    """How a quantity comes about from others.

    Attributes
    ----------
    quantity
        That it is.
    parts
        The names of the pointers, the finest first.
    turn
        What a turn of the coarsest is worth.
    tolerance
        In turns of the finer of two pointers.
    """

    quantity: Quantity
    parts: tuple[str, ...]
    turn: float
    tolerance: float
