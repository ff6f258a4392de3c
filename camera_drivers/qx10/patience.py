"""Waiting, for calls and for the time to pass: stopping is noticed, limits hold, and somebody hears of it.

A call runs in a thread of its own, because nothing else can be left when it hangs. Its caller looks after it: at the
limit, or when stopping was asked for, the call is aborted and left behind.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraSilentError
from camera_drivers.reporter import Reporter

T = TypeVar("T")

LOOK_S = 0.1  # how soon stopping is noticed
SAY_NS = 1_000_000_000  # how often somebody hears that we wait

NO_ANSWER = "no whole answer within its time"

_NS_PER_S = 1_000_000_000


class Stopped(Exception):
    """Stopping was asked for while something was waited for."""


class Patience:
    """Waits.

    Attributes
    ----------
    stop
        Ends every wait with `Stopped`; may be exchanged between waits.
    """

    def __init__(self, clock: Clock, reporter: Reporter) -> None:
        self._clock = clock
        self._reporter = reporter
        self.stop = threading.Event()

    def until_done(self, call: str, work: Callable[[], T], abort: Callable[[], None], *, limit_s: float) -> T:
        """The result of `work`, which runs in another thread; what it raises of CameraError is raised here.

        Raises
        ------
        CameraSilentError
            It took longer than `limit_s`.
        Stopped
            Stopping was asked for.
        """
        self.check()
        job = _Job(call, work)
        job.start()
        start_ns = said_ns = self._now_ns()
        while not job.done.wait(LOOK_S):
            now_ns = self._now_ns()
            if self.stop.is_set():
                abort()
                raise Stopped
            if now_ns - start_ns >= limit_s * _NS_PER_S:
                abort()
                raise CameraSilentError(call, NO_ANSWER, delivered=True)
            if now_ns - said_ns >= SAY_NS:
                self._reporter.waiting(call)
                said_ns = now_ns
        return job.outcome()

    def until(self, reason: str, monotonic_ns: int) -> None:
        """Come back at this time; raises Stopped."""
        self.check()
        while (now_ns := self._now_ns()) < monotonic_ns:
            self._reporter.waiting(reason)
            self._clock.wait_until(min(monotonic_ns, now_ns + SAY_NS), self.stop)
            self.check()

    def pause(self, reason: str, seconds: float) -> None:
        """Come back after so long; raises Stopped."""
        self.until(reason, self._now_ns() + round(seconds * _NS_PER_S))

    def poll(self, reason: str, condition: Callable[[], bool], *, every_s: float, limit_s: float) -> bool:
        """Ask again and again until it holds; False if it did not in time. Raises Stopped."""
        end_ns = self._now_ns() + round(limit_s * _NS_PER_S)
        while not condition():
            if self._now_ns() >= end_ns:
                return False
            self.pause(reason, every_s)
        return True

    def check(self) -> None:
        """Raise Stopped if stopping was asked for."""
        if self.stop.is_set():
            raise Stopped

    def _now_ns(self) -> int:
        return self._clock.read().monotonic_ns


class _Job(threading.Thread, Generic[T]):
    """Runs something and keeps what came of it; a daemon thread, since it may hang."""

    def __init__(self, name: str, work: Callable[[], T]) -> None:
        super().__init__(name=f"qx10 {name}", daemon=True)
        self._work = work
        self._results: list[T] = []
        self._error: CameraError | None = None
        self.done = threading.Event()

    def run(self) -> None:
        """Work; a bug keeps its traceback."""
        try:
            self._results.append(self._work())
        except CameraError as error:
            self._error = error
        finally:
            self.done.set()

    def outcome(self) -> T:
        """The result, once it is done."""
        if self._error is not None:
            raise self._error
        if not self._results:
            raise RuntimeError(f"{self.name} crashed; its traceback is above, please report it.")
        return self._results[0]
