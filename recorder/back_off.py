"""How long to wait before trying again: longer after each failure, up to a limit, and from the start after a success.

There is one camera and one disk to a box, so nothing is gained by waiting at random.
"""

from __future__ import annotations

from dataclasses import dataclass

_NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Pace:
    """The first wait and the longest, seconds; each is twice as long as the one before."""

    first_s: float
    longest_s: float


class BackOff:
    """The waits between one success and the next."""

    def __init__(self) -> None:
        self.failures = 0

    def next_ns(self, pace: Pace) -> int:
        """After one more failure: how long to wait now, ns."""
        doublings = min(self.failures, 30)
        self.failures += 1
        return round(min(pace.first_s * (1 << doublings), pace.longest_s) * _NS_PER_S)

    def reset(self) -> None:
        """It worked."""
        self.failures = 0
