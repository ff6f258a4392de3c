"""Gearing: where the hands of an altimeter or a clock point at a value, and what they tell of it.

Each hand tells the value but for whole turns of it. The coarsest tells it roughly and in full; each finer one must
point, within the panel's tolerance, where that puts it, and then says it better.
"""

from __future__ import annotations

import numpy as np

from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale, in_turn, shortest

# A coarse hand must tell the turns apart even if it is off by so many of its sigmas.
SURE_SIGMAS = 2.0


class Gearing:
    """How the hands of one dial, the finest first, follow from its value.

    Attributes
    ----------
    name, names
        Of the value, and of the hands.
    turns
        What a turn of each hand is worth.
    """

    def __init__(self, gauge: Gauge) -> None:
        combination = gauge.combination
        assert combination is not None  # noqa: S101 - the kind owns no other gauges
        quantities = {quantity.name: quantity for quantity in gauge.quantities}
        parts = [quantities[name] for name in combination.parts]
        self._scales = [Scale.of(part.marks, part.wraps) for part in parts]
        self.turns = [part.wraps or 0.0 for part in parts]
        self.names, self.name = combination.parts, combination.quantity.name
        self._tolerance, self._quantity = combination.tolerance, combination.quantity

    @property
    def share(self) -> float:
        """What part of the value's circle one turn of the finest hand is."""
        return self.turns[0] / self.turn

    @property
    def turn(self) -> float:
        """What a turn of the coarsest hand is worth."""
        return self.turns[-1]

    def values(self, finest_deg: Floats) -> Floats:
        """(D, T): all values at which the finest hand points in some directions, (D,)."""
        within = self.within(0, finest_deg)[:, None] + self.turns[0] * np.arange(round(self.turn / self.turns[0]))
        return in_turn(within, self.turn, self._quantity.lowest)

    def within(self, hand: int, angles_deg: Floats) -> Floats:
        """Return what a hand says by itself, within one turn of it."""
        return self._scales[hand].values_at(angles_deg)

    def angles_deg(self, hand: int, values: Floats) -> Floats:
        """Where a hand points at values."""
        return self._scales[hand].angles_of(in_turn(values, self.turns[hand]))

    def tolerance_deg(self, hand: int) -> float:
        """How far a hand may be from where the next finer one puts it."""
        return self._tolerance * FULL_CIRCLE_DEG * self.turns[max(hand - 1, 0)] / self.turns[hand]

    def counted(self, angles_deg: Floats) -> float:
        """Return the value that all hands tell, (K,): the coarsest roughly and in full, each finer one better."""
        value = float(self.within(len(angles_deg) - 1, angles_deg[-1:])[0])
        for hand in range(len(angles_deg) - 2, -1, -1):
            value = self.measured(hand, angles_deg, value)
        return value

    def measured(self, hand: int, angles_deg: Floats, value: float) -> float:
        """Return the value nearest to one at which a hand points where it does."""
        off = float(shortest(self.within(hand, angles_deg[[hand]])[0] - value, self.turns[hand]))
        return float(in_turn(np.array(value + off), self.turn, self._quantity.lowest))

    def agrees(self, value: float, angles_deg: Floats, sigmas_deg: Floats, seen: Mask) -> bool:
        """Tell whether all hands that are seen, (K,), point where the value has them, and tell turns apart."""
        for hand in range(1, len(seen)):
            finer = self.turns[hand - 1]
            off = abs(float(shortest(self.within(hand, angles_deg[[hand]])[0] - value, self.turns[hand])))
            doubt = off + SURE_SIGMAS * self.sigma(hand, angles_deg, sigmas_deg)
            if seen[hand] and (off > self._tolerance * finer or doubt > finer / 2):
                return False
        return True

    def sigma(self, hand: int, angles_deg: Floats, sigmas_deg: Floats) -> float:
        """How uncertain what a hand says by itself is."""
        return float(np.abs(self._scales[hand].slopes_at(angles_deg[[hand]])[0]) * sigmas_deg[hand])

    def circle_deg(self, value: float) -> float:
        """Return a value as an angle, from the lowest on, on the circle that is one turn of the coarsest hand."""
        return (value - self._quantity.lowest) / self.turn * FULL_CIRCLE_DEG
