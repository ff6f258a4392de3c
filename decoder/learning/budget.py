"""The uncertainty budget of a quantity: what its panel and flight leave in doubt, by cause and over its values.

A value's sigma is the root of the sum of squares of these and of what its own frame leaves in doubt (GUM, 5.1.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from decoder.panel.arrays import Floats
from decoder.panel.scale import Combination, Quantity, Scale, in_turn

# Over a scale, or over the turn of a pointer, causes change no faster than a sine does over a turn.
PLACES = 17


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
    """A quantity's.

    Attributes
    ----------
    values
        (K,), rising, in the quantity's unit.
    turn
        After how much of it all comes again: a turn of its finest pointer. None where nothing goes round.
    sigmas
        By cause (K,) standard uncertainties at these values, in the quantity's unit.
    """

    values: Floats
    turn: float | None
    sigmas: Mapping[Cause, Floats]

    def at(self, value: float) -> dict[Cause, float]:
        """Look up the standard uncertainties at a value by cause; beyond the ends as at these."""
        first = float(self.values[0])
        within = value if self.turn is None else float(in_turn(np.array(value), self.turn, first))
        return {cause: float(np.interp(within, self.values, sigma)) for cause, sigma in self.sigmas.items()}


def budgets(
    quantities: Iterable[Quantity], combinations: Sequence[Combination], parts_deg: PartsDeg
) -> dict[str, Budget]:
    """Draw up the budgets of all quantities that are measured; what is combined has that of its finest pointer."""
    drawn = {quantity.name: quantity for quantity in quantities if quantity.written is None}
    found = {name: _budget(quantity, quantity, parts_deg) for name, quantity in drawn.items()}
    for each in combinations:
        found[each.quantity.name] = _budget(each.quantity, drawn[each.parts[0]], parts_deg)
    return found


def _budget(quantity: Quantity, finest: Quantity, parts_deg: PartsDeg) -> Budget:
    low, high = quantity.range
    if finest.wraps is not None:
        high = low + finest.wraps
    values = np.linspace(low, high, PLACES)
    scale = Scale.of(finest.marks, finest.wraps)
    angles_deg = scale.angles_of(values)
    own_deg = parts_deg(finest.name, angles_deg)
    all_deg = np.sqrt(sum((np.square(sigma_deg) for sigma_deg in own_deg.values()), np.zeros(PLACES)))
    per_deg = scale.steepest_at(angles_deg, all_deg)
    sigmas = {cause: per_deg * sigma_deg for cause, sigma_deg in own_deg.items()}
    return Budget(values, finest.wraps, sigmas)
