"""Clocks."""

from __future__ import annotations

import threading
import time

from flight_file.reports import CameraStatus
from recorder.clock import AudibleClock, SimulatedClock, SystemClock
from recorder.testing import ManualClock


def test_system_clock_waits_and_is_interrupted() -> None:
    """It sleeps until the time has come, but not when `stop` is set."""
    clock, stop = SystemClock(), threading.Event()
    start = clock.read()
    clock.wait_until(start.monotonic_ns + 20_000_000, stop)
    waited_ns = clock.read().monotonic_ns - start.monotonic_ns
    stop.set()
    clock.wait_until(start.monotonic_ns + 10**12, stop)

    assert waited_ns >= 19_000_000
    assert abs(start.realtime_ns - time.time_ns()) < 60 * 10**9


def test_simulated_clock_jumps_forward_only() -> None:
    """Waiting takes no time and moves both sides; what is past already changes nothing."""
    clock, stop = SimulatedClock(1000), threading.Event()
    clock.wait_until(50, stop)
    clock.wait_until(20, stop)

    assert (clock.read().realtime_ns, clock.read().monotonic_ns) == (1050, 50)


def test_manual_clock_is_set_like_a_wall_clock() -> None:
    """Setting the wall clock leaves the monotonic side alone."""
    clock = ManualClock(1000)
    clock.advance(5)
    clock.set_realtime(7)

    assert (clock.read().realtime_ns, clock.read().monotonic_ns) == (7, 5)


def test_driver_that_only_waits_can_be_heard() -> None:
    """A replay whose next picture is an hour away says every few seconds that it waits."""
    heard: list[str] = []

    class Ear:
        """A reporter."""

        def report(self, status: CameraStatus) -> None: ...

        def lost(self, reason: str) -> None: ...

        def waiting(self, reason: str) -> None:
            heard.append(reason)

    clock = ManualClock(0)
    AudibleClock(clock, Ear()).wait_until(3600 * 10**9, threading.Event())

    assert clock.read().monotonic_ns == 3600 * 10**9
    assert len(heard) == 720
