"""The simulated camera's clock, lens and settings, each of which takes its own time to follow a call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from camera_drivers.clock import Clock
from camera_drivers.qx10.simulator.methods import CHOICES
from flight_file.frame import NS_PER_S

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
WIDE_MM, TELE_MM = 4.45, 44.5
STEPS = (4, 3, 5)  # percent, in turn; a step is never quite like the one before
DIRECTIONS = {"in": 1, "out": -1}


class CameraTime:
    """The camera's clock.

    Parameters
    ----------
    clock
        The machine's.
    offset_s
        By how much it is ahead of that.
    """

    def __init__(self, clock: Clock, offset_s: float) -> None:
        self._clock = clock
        self._offset_ns = round(offset_s * NS_PER_S)

    def now(self) -> datetime:
        """Show the time without its zone, as the camera does."""
        return _EPOCH + timedelta(microseconds=(self._clock.read().realtime_ns + self._offset_ns) // 1000)

    def turn(self, seconds: float) -> None:
        """Turn the clock ahead by this much, or back."""
        self._offset_ns += round(seconds * NS_PER_S)

    def set(self, told: Mapping[str, Any]) -> None:
        """Set the clock from the parameters of `setCurrentTime`; raises LookupError, TypeError or ValueError."""
        shown = datetime.strptime(told["dateTime"], "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)
        zone = timedelta(minutes=told["timeZoneOffsetMinute"] + told["dstOffsetMinute"])
        set_ns = (shown + zone - _EPOCH) // timedelta(microseconds=1) * 1000
        self._offset_ns = set_ns - self._clock.read().realtime_ns


class Lens:
    """A zoom lens; used by one thread at a time.

    Parameters
    ----------
    percent_per_s
        Speed.
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
        """The position now, 0 (wide) to 100 (tele) percent."""
        seconds = (self._clock.read().monotonic_ns - self._since_ns) / NS_PER_S
        return min(max(self._at + self._moving * self._rate * seconds, 0.0), 100.0) if self._moving else self._at

    @property
    def focal_length_mm(self) -> float:
        """The focal length now, not quite linear in its logarithm."""
        share = self.position / 100
        return WIDE_MM * math.exp(math.log(TELE_MM / WIDE_MM) * share * (0.85 + 0.15 * share))

    def act(self, direction: str, movement: str) -> bool:
        """Move the lens; return False for a stop without a movement, which the camera refuses."""
        sign = DIRECTIONS[direction]
        if movement == "stop" and sign != self._moving:
            return False
        self._at, self._since_ns = self.position, self._clock.read().monotonic_ns
        self._moving = sign if movement == "start" else 0
        if movement == "1shot":
            self._at = min(max(self._at + sign * STEPS[self._steps % len(STEPS)], 0.0), 100.0)
            self._steps += 1
        return True


class Settings:
    """The settings, as after switching on until they are changed.

    Attributes
    ----------
    chosen
        Name and last chosen value of each.
    """

    def __init__(self, clock: Clock, apply_s: float) -> None:
        self._clock = clock
        self._apply_ns = round(apply_s * NS_PER_S)
        self.chosen: dict[str, object] = {name: choice.first for name, choice in CHOICES.items()}
        self._shown = dict(self.chosen)
        self._shows_at_ns = 0

    def put(self, name: str, value: object) -> None:
        """Choose a value; `shown` keeps the old one until it has been applied."""
        self.shown(name)
        self.chosen[name] = value
        self._shows_at_ns = self._clock.read().monotonic_ns + self._apply_ns

    def shown(self, name: str) -> object:
        """Report the setting as the camera does."""
        if self._clock.read().monotonic_ns >= self._shows_at_ns:
            self._shown = dict(self.chosen)
        return self._shown[name]
