"""What a column of flight data means: the marks it is read off, or the other columns that it comes from."""

from __future__ import annotations

from dataclasses import dataclass

from decoder.scale_marks import Marks


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
    """

    name: str
    gauge: str
    unit: str
    marks: Marks
    wraps: float | None
    covered_by: str | None
    max_rate: float | None
    lowest: float = 0.0

    @property
    def full_scale(self) -> float:
        """The span of values between the outermost marks, or of a full turn."""
        return self.wraps or abs(self.marks[-1][1] - self.marks[0][1])

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest value of the scale."""
        if self.wraps is not None:
            return self.lowest, self.lowest + self.wraps
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
