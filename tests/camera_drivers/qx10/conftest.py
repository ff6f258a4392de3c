"""A simulated camera that is quick, a driver that is impatient, and somebody who listens to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import pytest

from camera_drivers.clock import Clock
from camera_drivers.qx10.camera import Qx10Camera
from camera_drivers.qx10.options import SSDP_ADDRESS, Qx10Limits, Qx10Settings
from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.frame import ClockReading, Frame
from recorder.host import SystemClock
from tests.camera_drivers.listening import Listener, taken_by_and_by
from tests.camera_drivers.qx10.strangers import Strangers

LIMITS = Qx10Limits(
    search_s=2.0,
    connect_s=2.0,
    call_s=2.0,
    shot_s=2.0,
    exposure_s=10.0,
    download_s=10.0,
    event_s=5.0,
    ready_s=5.0,
    settle_s=0.6,
    zoom_s=5.0,
    stall_s=0.5,
    picture_mib=1,
)
QUICK = Behaviour(
    shot_s=0.01,
    save_s=0.0,
    long_poll_s=0.5,
    delay_s=0.3,
    reboot_s=1.0,
    error_s=0.2,
    silent_s=0.5,
    zoom_percent_per_s=400.0,
)


def settings_for(search_address: tuple[str, int] = SSDP_ADDRESS, **wanted: Any) -> Qx10Settings:  # noqa: ANN401
    """What the driver is told, and where it sends its search."""

    class Here(Qx10Settings):
        pass

    Here.search_address = search_address
    return Here(driver="qx10", **wanted)


class JumpingClock(SystemClock):
    """The machine's clocks, but a wait is over at once, and both are ahead by as much from then on.

    For one driver without a call that waits for news: of two that wait, each would jump ahead of the other.
    """

    def __init__(self) -> None:
        self._ahead_ns = 0

    def read(self) -> ClockReading:
        """The machine's time and all the waits."""
        now = super().read()
        return ClockReading(now.realtime_ns + self._ahead_ns, now.monotonic_ns + self._ahead_ns)

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:  # noqa: ARG002 - it never waits
        """Jump."""
        self._ahead_ns += max(0, monotonic_ns - self.read().monotonic_ns)


@dataclass
class Bench:
    """A simulated camera, a driver for it, and who listens."""

    simulated: SimulatedQx10
    camera: Qx10Camera
    listener: Listener
    failures: list[str] = field(default_factory=list)

    def take(self, number: int) -> list[Frame]:
        """So many frames; the camera is connected again as the recorder does it."""
        return taken_by_and_by(self.camera, number, self.failures)


MakeBench = Callable[..., Bench]


@pytest.fixture
def listener() -> Listener:
    """Who hears the driver."""
    return Listener()


@pytest.fixture
def strangers() -> Iterator[Strangers]:
    """They serve until the test ends."""
    with Strangers() as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture
def make_bench(listener: Listener) -> Iterator[MakeBench]:
    """A simulated camera with faults and changes, and a driver with options; both end with the test."""
    with ExitStack() as stack:

        def make(
            *faults: str,
            behaviour: dict[str, Any] | None = None,
            clock: Clock | None = None,
            **options: Any,  # noqa: ANN401
        ) -> Bench:
            clock = clock or SystemClock()
            simulated = stack.enter_context(
                SimulatedQx10(clock, behaviour=replace(QUICK, **(behaviour or {})), search_port=0)
            )
            for fault in faults:
                simulated.fault_schedule.order_as_text(fault)
            wanted: dict[str, Any] = {"url": simulated.url, "interval_s": 0.0, "limits": LIMITS, **options}
            return Bench(simulated, Qx10Camera(settings_for(**wanted), clock, listener), listener)

        yield make


@pytest.fixture
def make_quick_bench(make_bench: MakeBench) -> MakeBench:
    """The same where what the driver waits for comes at once."""
    return partial(make_bench, clock=JumpingClock(), long_poll=False)
