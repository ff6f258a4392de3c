"""The uncertainty budget of a quantity: what its panel and flight leave uncertain, by cause and over its values.

A value's sigma is the root sum of squares of these and of its own frame's uncertainty (GUM, 5.1.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from decoder.panel.arrays import Floats
from decoder.panel.scale import Combination, Quantity, Scale, in_turn
from decoder.panel.thresholds import CONFIDENCE_SIGMAS

# In degrees, causes vary along a scale, or over a pointer's turn, no faster than a sine over a turn. In values, they
# also change around each mark, where the value of a degree changes, as far as a value's interval reaches.
PLACES = 17
AROUND = (-1.0, 0.0, 1.0)


class Cause(StrEnum):
    """Why a value is not exact beyond what its own frame shows."""

    DRAWN = "drawn"
    """How precisely somebody drew its marks."""
    PIVOT = "pivot"
    """Where it turns."""
    VIEWED = "viewed"
    """From which side the camera sees what turns above its marks."""
    PLACED = "placed"
    """Where its dial is found."""


PartsDeg = Callable[[str, Floats], Mapping[Cause, Floats]]
"""By cause what the readings of a quantity, by its name, at (N,) angles are uncertain by: (N,)."""


@dataclass(frozen=True, slots=True)
class Budget:
    """The uncertainty budget of a quantity.

    Attributes
    ----------
    values
        (K,), rising, in the quantity's unit.
    turn
        The value after which everything repeats: a turn of its finest pointer. None if it does not repeat.
    sigmas
        For each cause (K,) standard uncertainties at these values, in the quantity's unit.
    """

    values: Floats
    turn: float | None
    sigmas: Mapping[Cause, Floats]

    def at(self, value: float) -> dict[Cause, float]:
        """Look up the standard uncertainties at a value by cause; beyond the ends they stay constant."""
        first = float(self.values[0])
        within = value if self.turn is None else float(in_turn(np.array(value), self.turn, first))
        return {cause: float(np.interp(within, self.values, sigma)) for cause, sigma in self.sigmas.items()}


def budgets(
    quantities: Iterable[Quantity], combinations: Sequence[Combination], parts_deg: PartsDeg
) -> dict[str, Budget]:
    """Compute the budgets of all measured quantities; a combined one has that of its finest pointer."""
    drawn = {quantity.name: quantity for quantity in quantities if quantity.written is None}
    found = {name: _budget(quantity, quantity, parts_deg) for name, quantity in drawn.items()}
    for each in combinations:
        found[each.quantity.name] = _budget(each.quantity, drawn[each.parts[0]], parts_deg)
    return found


def _budget(quantity: Quantity, finest: Quantity, parts_deg: PartsDeg) -> Budget:
    low, high = quantity.range
    if finest.wraps is not None:
        high = low + finest.wraps
    scale = Scale.of(finest.marks, finest.wraps)
    reach_deg = CONFIDENCE_SIGMAS * _whole(parts_deg(finest.name, scale.angles_deg))
    around_marks = scale.values_at(np.concatenate([scale.angles_deg + side * reach_deg for side in AROUND]))
    if finest.wraps is not None:
        around_marks = in_turn(around_marks, finest.wraps, low)
    within = around_marks[(low < around_marks) & (around_marks < high)]
    values = np.unique(np.concatenate([np.linspace(low, high, PLACES), within]))
    angles_deg = scale.angles_of(values)
    own_deg = parts_deg(finest.name, angles_deg)
    per_deg = scale.steepest_at(angles_deg, _whole(own_deg))
    sigmas = {cause: per_deg * sigma_deg for cause, sigma_deg in own_deg.items()}
    return Budget(values, finest.wraps, sigmas)


def _whole(parts: Mapping[Cause, Floats]) -> Floats:
    """(N,): the root sum of squares of all causes."""
    whole: Floats = np.sqrt(np.sum([np.square(part) for part in parts.values()], axis=0))
    return whole
