"""Waiting, for calls and for time to pass: it can be stopped, has limits, and is reported.

A call runs in a thread of its own, because only a thread can be abandoned when it hangs. Its caller watches it: at the
limit, or when a stop was requested, the call is aborted and abandoned. `Notes` reports what is worth a line in the
flight, each thing once however often the camera is connected again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from camera_drivers.clock import Clock
from camera_drivers.errors import CameraError, CameraSilentError, CameraUnreachableError
from camera_drivers.reporter import Reporter
from camera_drivers.thresholds import LOOK_S, SAY_S
from flight_file.frame import NS_PER_S, CameraStatus

T = TypeVar("T")
NO_THREAD = "the system has no thread left for it"
NO_ANSWER = "no whole answer within its time"
NO_MEMORY = "no memory is left for the answer"
CRASHED = "the answer crashed the driver, whose traceback is in the log"


class Notes:
    """Reports each thing once."""

    def __init__(self, reporter: Reporter) -> None:
        self._reporter = reporter
        self._said: set[tuple[str, str]] = set()

    def say(self, state: str, reason: str, *, sequence: int | None = None) -> None:
        """Report it; `sequence` is the frame it concerns, if any."""
        self._reporter.report(CameraStatus(state, reason, sequence=sequence))

    def report(self, status: CameraStatus) -> None:
        """Report a complete status."""
        self._reporter.report(status)

    def say_once(self, state: str, reason: str) -> None:
        """Report it unless it was reported before; `reason` must come from a limited set of sentences."""
        if (state, reason) not in self._said:
            self._said.add((state, reason))
            self.say(state, reason)


class Stopped(Exception):
    """A stop was requested during a wait."""


class Waiter:
    """Interruptible waits with limits.

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
        """Run `work` in another thread and return its result; a CameraError that it raises is raised here.

        Raises
        ------
        CameraSilentError
            It took longer than `limit_s`.
        Stopped
            Stopping was asked for.
        """
        self.check()
        job = Job(call, work)
        begin(job, call)
        start_ns = said_ns = self._now_ns()
        while not job.done.wait(LOOK_S):
            now_ns = self._now_ns()
            if self.stop.is_set():
                abort()
                raise Stopped
            if now_ns - start_ns >= limit_s * NS_PER_S:
                abort()
                raise CameraSilentError(call, NO_ANSWER)
            if now_ns - said_ns >= round(SAY_S * NS_PER_S):
                self._reporter.waiting(call)
                said_ns = now_ns
        return job.outcome()

    def until(self, reason: str, monotonic_ns: int) -> None:
        """Wait until this time; raises Stopped."""
        self.check()
        while (now_ns := self._now_ns()) < monotonic_ns:
            self._reporter.waiting(reason)
            self._clock.wait_until(min(monotonic_ns, now_ns + round(SAY_S * NS_PER_S)), self.stop)
            self.check()

    def pause(self, reason: str, seconds: float) -> None:
        """Wait this long; raises Stopped."""
        self.until(reason, self._now_ns() + round(seconds * NS_PER_S))

    def poll(self, reason: str, condition: Callable[[], bool], *, every_s: float, limit_s: float) -> bool:
        """Poll a condition until it holds; return False if it did not in time. Raises Stopped."""
        end_ns = self._now_ns() + round(limit_s * NS_PER_S)
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


def begin(thread: threading.Thread, call: str) -> None:
    """Start a thread for a call; raises CameraUnreachableError where the system has none left: it may have one soon."""
    try:
        thread.start()
    except RuntimeError as error:
        raise CameraUnreachableError(call, NO_THREAD) from error


class Job(threading.Thread, Generic[T]):
    """Runs a function in a daemon thread, since it may hang, and keeps its outcome.

    What it runs reads what a stranger sent, and ends in a result or a CameraError, whatever that was: a bug that the
    stranger found must not end the recording.

    Attributes
    ----------
    done
        Set as soon as there is an outcome.
    """

    def __init__(self, call: str, work: Callable[[], T]) -> None:
        super().__init__(name=f"camera {call}", daemon=True)
        self._call = call
        self._work = work
        self._results: list[T] = []
        self._error: CameraError | None = None
        self.done = threading.Event()

    def run(self) -> None:
        """Run the function; the traceback of a bug goes to stderr."""
        try:
            self._results.append(self._work())
        except CameraError as error:
            self._error = error
        except MemoryError:
            self._error = CameraSilentError(self._call, NO_MEMORY)
        finally:
            self.done.set()

    def outcome(self) -> T:
        """Wait for the result; a CameraError of the job is raised here."""
        if self._error is not None:
            raise self._error
        if not self._results:
            raise CameraSilentError(self._call, CRASHED)
        return self._results[0]
