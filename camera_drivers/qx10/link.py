"""The way to one camera: its address, and how long things may take there."""

from __future__ import annotations

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraSilentError
from camera_drivers.qx10.addresses import BadUrlError, at_host
from camera_drivers.qx10.exchange import Answer, Exchange
from camera_drivers.qx10.options import Limits
from camera_drivers.qx10.patience import Patience
from camera_drivers.reporter import Reporter


class Link:
    """Requests to one camera, from one thread; each has a limit for the whole of it.

    Parameters
    ----------
    host
        The camera's address; nothing else is ever called.
    """

    def __init__(self, host: str, limits: Limits, patience: Patience) -> None:
        self.host = host
        self.limits = limits
        self.patience = patience

    def get(self, call: str, url: str, *, max_bytes: int, limit_s: float) -> Answer:
        """What is at a URL, whatever host it names; raises CameraSilentError and Stopped."""
        return self._fetch(call, "GET", self.own(call, url), None, max_bytes=max_bytes, limit_s=limit_s)

    def post(self, call: str, url: str, body: bytes, *, max_bytes: int, limit_s: float) -> Answer:
        """The answer to a body; raises as `get`."""
        return self._fetch(call, "POST", self.own(call, url), body, max_bytes=max_bytes, limit_s=limit_s)

    def own(self, call: str, url: str) -> str:
        """A URL with the camera's own host; raises CameraSilentError if it is no URL."""
        try:
            return at_host(url, self.host)
        except BadUrlError as error:
            raise CameraSilentError(call, "the camera gave an address that is none", delivered=True) from error

    def exchange(self, quiet_s: float) -> Exchange:
        """A request that is not made yet."""
        return Exchange(self.host, connect_s=self.limits.connect_s, quiet_s=quiet_s)

    def parallel(self, clock: Clock, reporter: Reporter) -> Link:
        """A second way to the same camera, for another thread."""
        return Link(self.host, self.limits, Patience(clock, reporter))

    def _fetch(self, call: str, method: str, url: str, body: bytes | None, *, max_bytes: int, limit_s: float) -> Answer:
        exchange = self.exchange(2 * limit_s)  # it is the limit for the whole that ends a call

        def work() -> Answer:
            with exchange:
                return exchange.fetch(call, method, url, body=body, max_bytes=max_bytes)

        return self.patience.until_done(call, work, exchange.abort, limit_s=limit_s)
