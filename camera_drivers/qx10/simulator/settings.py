"""The simulated camera's settings: what was chosen last is what it does; what it shows follows a little later."""

from __future__ import annotations

from camera_drivers.clock import Clock
from camera_drivers.qx10.simulator.methods import CHOICES

_NS_PER_S = 1_000_000_000


class Settings:
    """As after switching on, until they are changed.

    Attributes
    ----------
    chosen
        Name and value of each, as it was chosen last.
    """

    def __init__(self, clock: Clock, apply_s: float) -> None:
        self._clock = clock
        self._apply_ns = round(apply_s * _NS_PER_S)
        self.chosen: dict[str, object] = {name: choice.first for name, choice in CHOICES.items()}
        self._shown = dict(self.chosen)
        self._shows_at_ns = 0

    def put(self, name: str, value: object) -> None:
        """Choose a value; `shown` keeps the old one until it has been applied."""
        self.shown(name)
        self.chosen[name] = value
        self._shows_at_ns = self._clock.read().monotonic_ns + self._apply_ns

    def shown(self, name: str) -> object:
        """What the camera tells of it."""
        if self._clock.read().monotonic_ns >= self._shows_at_ns:
            self._shown = dict(self.chosen)
        return self._shown[name]
