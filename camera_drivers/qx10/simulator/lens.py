"""The simulated lens: it moves with time, overshoots, and stands at wide after switching on."""

from __future__ import annotations

import math

from camera_drivers.clock import Clock

WIDE_MM, TELE_MM = 4.45, 44.5
STEPS = (4, 3, 5)  # percent, in turn; a step is never quite like the one before
DIRECTIONS = {"in": 1, "out": -1}

_NS_PER_S = 1_000_000_000


class Lens:
    """A zoom lens; the caller sees to it that one thread at a time uses it.

    Parameters
    ----------
    percent_per_s
        How fast it goes.
    """

    def __init__(self, clock: Clock, percent_per_s: float) -> None:
        self._clock = clock
        self._rate = percent_per_s
        self._at = 0.0
        self._moving = 0
        self._since_ns = 0
        self._steps = 0

    @property
    def position(self) -> float:
        """0 (wide) to 100 (tele) percent, now."""
        seconds = (self._clock.read().monotonic_ns - self._since_ns) / _NS_PER_S
        return min(max(self._at + self._moving * self._rate * seconds, 0.0), 100.0) if self._moving else self._at

    @property
    def focal_length_mm(self) -> float:
        """Not quite even in its logarithm, as no lens is."""
        share = self.position / 100
        return WIDE_MM * math.exp(math.log(TELE_MM / WIDE_MM) * share * (0.85 + 0.15 * share))

    def act(self, direction: str, movement: str) -> bool:
        """Move; False where the camera refuses: stopping a movement that was not begun."""
        sign = DIRECTIONS[direction]
        if movement == "stop" and sign != self._moving:
            return False
        self._at, self._since_ns = self.position, self._clock.read().monotonic_ns
        self._moving = sign if movement == "start" else 0
        if movement == "1shot":
            self._at = min(max(self._at + sign * STEPS[self._steps % len(STEPS)], 0.0), 100.0)
            self._steps += 1
        return True
