"""When a stream's pictures were sent, by the box's clock: timestamps are precise, the network's delay varies.

The fastest picture of all arrived almost as soon as it was sent, and the sender's timestamps say by how much later the
others were sent. Where the network or the recorder stood still, pictures arrive late, however long that was; only
timestamps that go back show that they were restarted.
"""

from __future__ import annotations


class Delay:
    """Estimates by how much the pictures of one stream arrive after their timestamps.

    The smallest difference of arrival and timestamp is used. It is forgotten slowly, as clocks drift.
    """

    DRIFT = 1e-4  # a crystal's, generously
    JUMP_NS = 5_000_000_000  # no picture is that far out of order: the timestamps were restarted

    def __init__(self) -> None:
        self._least_ns: int | None = None
        self._at_ns = 0
        self._shown_ns = 0

    def taken_ns(self, shown_ns: int, arrived_ns: int) -> int:
        """Estimate when the picture with this timestamp would have arrived without delay, by the clock of its arrival.

        Parameters
        ----------
        shown_ns
            By the sender's clock, from an arbitrary start.
        """
        delay_ns = arrived_ns - shown_ns
        if self._least_ns is not None and self._shown_ns - shown_ns < self.JUMP_NS:
            delay_ns = min(delay_ns, self._least_ns + round((arrived_ns - self._at_ns) * self.DRIFT))
        self._least_ns, self._at_ns, self._shown_ns = delay_ns, arrived_ns, shown_ns
        return shown_ns + delay_ns
