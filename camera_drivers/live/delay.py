"""When pictures of a stream were sent, by the box's clock: the sender counts well, and the network is late at times.

The picture that came fastest of all came hardly later than it was sent, and the sender's timestamps say by how much the
others were sent later.
"""

from __future__ import annotations


class Delay:
    """Estimates by how much the pictures of one stream arrive after their timestamps.

    The smallest difference of arrival and timestamp is the one to go by. It is forgotten slowly, as clocks drift.
    """

    DRIFT = 1e-4  # a crystal's, generously
    JUMP_NS = 5_000_000_000  # more than any picture is late: the timestamps have begun anew

    def __init__(self) -> None:
        self._least_ns: int | None = None
        self._at_ns = 0

    def taken_ns(self, shown_ns: int, arrived_ns: int) -> int:
        """Estimate when the picture with this timestamp would have come without delay, by the clock of its arrival.

        Parameters
        ----------
        shown_ns
            By the sender's clock, from an arbitrary start.
        """
        delay_ns = arrived_ns - shown_ns
        if self._least_ns is not None:
            allowed_ns = self._least_ns + round((arrived_ns - self._at_ns) * self.DRIFT)
            if abs(delay_ns - allowed_ns) < self.JUMP_NS:
                delay_ns = min(delay_ns, allowed_ns)
        self._least_ns, self._at_ns = delay_ns, arrived_ns
        return shown_ns + delay_ns
