"""Everything the recorder takes from its machine, above all the clocks; tests pass in a machine of their own.

`WallClock` notices when somebody sets the wall clock, by its jump relative to the monotonic one. A clock that is slewed
(by at most 0.05 %, the kernel's limit) does not count as set. A machine that slept looks as if its clock had been set
forward.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from pathlib import Path

from camera_drivers.clock import Clock
from camera_drivers.reporter import Reporter
from flight_file.frame import NS_PER_S, ClockReading
from recorder.thresholds import CLOCK_JUMP_NS, CLOCK_SLEWING, CLOCKS_TOGETHER_NS, SAY_S

_TRIES = 3
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LATEST_NS = 253_402_300_799 * 10**9  # the end of the year 9999, where datetime ends
_STDERR = 2
_M_ARENA_MAX = -8  # malloc.h of glibc
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_THERMAL_ZONES = Path("/sys/class/thermal")
_SYNCHRONIZED = Path(
    "/run/systemd/timesync/synchronized"
)  # made by systemd-timesyncd; the service may not ask the kernel


class SystemClock:
    """The machine's clocks."""

    name = "system"

    def read(self) -> ClockReading:
        """Read CLOCK_REALTIME and CLOCK_MONOTONIC together, to a millisecond unless the machine is very busy."""
        for _ in range(_TRIES):
            before_ns = time.monotonic_ns()
            realtime_ns = time.time_ns()
            took_ns = time.monotonic_ns() - before_ns
            if took_ns < CLOCKS_TOGETHER_NS:
                break
        return ClockReading(realtime_ns=realtime_ns, monotonic_ns=before_ns + took_ns // 2)

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Sleep; wakes up at once when `stop` is set."""
        stop.wait(max(0, monotonic_ns - time.monotonic_ns()) / NS_PER_S)


class ReportingClock:
    """A clock that reports every few seconds that it waits, for a driver that does nothing else."""

    def __init__(self, clock: Clock, reporter: Reporter) -> None:
        self._clock = clock
        self._reporter = reporter

    def read(self) -> ClockReading:
        """Read the other clock."""
        return self._clock.read()

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:
        """Wait as the other clock does."""
        while not stop.is_set() and (now_ns := self._clock.read().monotonic_ns) < monotonic_ns:
            self._reporter.waiting("the next picture is not due yet")
            self._clock.wait_until(min(monotonic_ns, now_ns + round(SAY_S * NS_PER_S)), stop)


class SimulatedClock:
    """A clock that stands still until somebody waits for it, and then is there at once.

    Parameters
    ----------
    realtime_ns
        What it shows first, UTC; its monotonic side begins at 0.
    """

    name = "simulated"

    def __init__(self, realtime_ns: int) -> None:
        self._start_ns = realtime_ns
        self._elapsed_ns = 0
        self._lock = threading.Lock()

    def read(self) -> ClockReading:
        """Read the simulated time."""
        with self._lock:
            return ClockReading(realtime_ns=self._start_ns + self._elapsed_ns, monotonic_ns=self._elapsed_ns)

    def wait_until(self, monotonic_ns: int, stop: threading.Event) -> None:  # noqa: ARG002 - it never waits
        """Jump to this time; a time in the past changes nothing."""
        with self._lock:
            self._elapsed_ns = max(self._elapsed_ns, monotonic_ns)


class WallClock:
    """Compares each reading with the one before."""

    def __init__(self) -> None:
        self._last: ClockReading | None = None

    def jump_ns(self, at: ClockReading) -> int:
        """Return by how much the wall clock was set since the last reading, ns; 0 if it was not."""
        last, self._last = self._last, at
        if last is None:
            return 0
        passed_ns = at.monotonic_ns - last.monotonic_ns
        jump_ns = at.realtime_ns - last.realtime_ns - passed_ns
        return jump_ns if abs(jump_ns) > CLOCK_JUMP_NS + CLOCK_SLEWING * abs(passed_ns) else 0


def jump_in_words(jump_ns: int) -> str:
    """Say by how much the wall clock was set: `the wall clock was set forward by 3.200 s`."""
    way = "forward" if jump_ns > 0 else "back"
    return f"the wall clock was set {way} by {abs(jump_ns) / 1e9:.3f} s"


def utc_text(time_ns: float | None) -> str | None:
    """Format nanoseconds since the epoch as ISO 8601, to the microsecond; None for what no calendar shows."""
    if time_ns is None or not 0 <= time_ns <= _LATEST_NS:
        return None
    return (_EPOCH + timedelta(microseconds=int(time_ns) // 1000)).isoformat().replace("+00:00", "Z")


@dataclass(frozen=True, slots=True)
class Host:
    """A machine.

    Attributes
    ----------
    clock
        Its clocks.
    name, boot_id
        Which machine, and which boot of it; empty to keep that out of the flight.
    versions
        Version by name of software.
    free_bytes
        Free bytes on the file system of a path; None if the system does not say.
    temperatures_c
        By sensor, degrees Celsius.
    clock_state
        What a health report says about the wall clock.
    """

    clock: Clock
    name: str
    boot_id: str
    versions: Mapping[str, str]
    free_bytes: Callable[[Path], int | None]
    temperatures_c: Callable[[], Mapping[str, float]]
    clock_state: Callable[[], str] = lambda: "system"


def this_host() -> Host:
    """Describe the machine this runs on."""
    return Host(
        clock=SystemClock(),
        name=platform.node(),
        boot_id=_boot_id(),
        versions={"recorder": version("image-flight-recorder"), "python": platform.python_version()},
        free_bytes=_free_bytes,
        temperatures_c=_temperatures_c,
        clock_state=_clock_state,
    )


def fixed_host(clock: Clock) -> Host:
    """Describe a machine that leaves no trace in a flight: the same recording made twice gives the same bytes."""
    return Host(
        clock=clock, name="", boot_id="", versions={}, free_bytes=lambda _path: None, temperatures_c=dict[str, float]
    )


def share_one_heap() -> None:
    """Let all threads of this process allocate from one heap; to be called before there are several.

    glibc gives each new thread a heap of its own, up to eight a core, and keeps the pages that it once touched. On two
    cores that is 5 MiB, which looks like a leak for thousands of calls. Another C library has no such setting.
    """
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def hold_standard_descriptors() -> None:
    """Open those of stdin, stdout and stderr that are closed, on nothing; to be called before any file is opened.

    Otherwise a flight file gets the number of stderr, and log lines and last words go into it.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        continue
    os.close(descriptor)


def _boot_id() -> str:
    try:
        return _BOOT_ID.read_text("ascii").strip()
    except OSError:
        return ""


def _free_bytes(path: Path) -> int | None:
    try:
        return shutil.disk_usage(path).free
    except OSError:
        return None


def _clock_state() -> str:
    return "system, synchronized since the boot" if os.path.exists(_SYNCHRONIZED) else "system"  # noqa: PTH110 - never raises


def _temperatures_c() -> dict[str, float]:
    found = {}
    with suppress(OSError):  # no such folder, or no file can be opened at the moment
        for zone in sorted(each for each in _THERMAL_ZONES.iterdir() if each.name.startswith("thermal_zone")):
            with suppress(OSError, ValueError):
                found[zone.name] = int((zone / "temp").read_text("ascii")) / 1000  # the kernel gives millidegrees
    return found
