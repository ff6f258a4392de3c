"""Everything the recorder takes from the machine it runs on, in one object, so that a test can bring its own."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from camera_drivers.clock import Clock
from recorder.clock import SystemClock

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_THERMAL_ZONES = Path("/sys/class/thermal")
_SYNCHRONIZED = Path(
    "/run/systemd/timesync/synchronized"
)  # made by systemd-timesyncd; reading the kernel is forbidden us


@dataclass(frozen=True, slots=True)
class Host:
    """A machine.

    Attributes
    ----------
    clock
        Its clocks.
    name, boot_id
        Which machine, and which boot of it; empty where that shall stay out of the flight.
    versions
        Version by name of software.
    free_bytes
        Room left where a path lies, bytes; None if the system does not say.
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
    """The machine this runs on."""
    return Host(
        clock=SystemClock(),
        name=platform.node(),
        boot_id=_boot_id(),
        versions={"recorder": version("image-flight-recorder"), "python": platform.python_version()},
        free_bytes=_free_bytes,
        temperatures_c=_temperatures_c,
        clock_state=_clock_state,
    )


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
    return "system, synchronized since the boot" if _SYNCHRONIZED.exists() else "system"


def _temperatures_c() -> dict[str, float]:
    found = {}
    for zone in sorted(_THERMAL_ZONES.glob("thermal_zone*")):
        try:
            found[zone.name] = int((zone / "temp").read_text("ascii")) / 1000  # the kernel gives millidegrees
        except (OSError, ValueError):
            continue
    return found
