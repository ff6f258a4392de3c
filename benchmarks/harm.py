"""What can happen to a box, done on purpose: its disk, its clock, its directory, its camera."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.faults import DESCRIPTION, DOWNLOAD, FAULTS, SHOT
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.errors import FlightNotWrittenError
from flight_file.files import DurableFile
from flight_file.frame import ClockReading
from recorder.host import SystemClock

HARMED = (sys.executable, "-c", "from benchmarks.harm import be_harmed; be_harmed()")
"""`recorder`, with a disk that fails and a clock that is set as standard input says: `disk ERRNO`, `clock SECONDS`."""

QUICK = Behaviour(shot_s=0.01, save_s=0.0, long_poll_s=0.5, delay_s=0.3, reboot_s=0.6, error_s=0.2, silent_s=0.5)
"""A minute of flying in a few seconds."""
LIMITS = {
    "connect_s": 2.0,
    "call_s": 2.0,
    "shot_s": 2.0,
    "exposure_s": 10.0,
    "download_s": 10.0,
    "event_s": 5.0,
    "ready_s": 5.0,
    "settle_s": 0.6,
    "picture_mib": 1,
}
"""For such a camera."""
FIRST_FAULT, BETWEEN_FAULTS = 2, 3

Patch = Callable[[object, str, object], None]


def faults_of(place: str) -> list[str]:
    """All faults that the simulated camera has there."""
    return [fault.name for fault in FAULTS.values() if fault.place == place]


def order_all_faults(camera: SimulatedQx10) -> int:
    """Order each fault of a still once, with good pictures between them; gives how many shots it takes."""
    for place in (SHOT, DOWNLOAD):
        for number, name in enumerate(faults_of(place)):
            camera.fault_schedule.order(name, at=FIRST_FAULT + BETWEEN_FAULTS * number)
    for name in faults_of(DESCRIPTION):
        camera.fault_schedule.order(name)
    return FIRST_FAULT + BETWEEN_FAULTS * len(faults_of(SHOT))


class Disk:
    """A small file system of its own at `path`, mounted from `source`."""

    def __init__(self, path: Path, source: Path) -> None:
        self.path = path
        self._source = source

    def pull(self) -> None:
        """Take it away, whoever uses it."""
        _call("umount", "--lazy", self.path)

    def plug(self) -> None:
        """Bring it back with what was on it."""
        _call("mount", "--bind", self._source, self.path)

    def grow(self) -> None:
        """Give it more room than anybody here needs."""
        _call("mount", "-o", "remount,size=64m", self._source)

    def remount(self, how: str) -> None:
        """Mount it again, `ro` or `rw`."""
        _call("mount", "-o", f"remount,bind,{how}", self.path)


@contextmanager
def mounted_disk(folder: Path) -> Iterator[Disk]:
    """A disk of 8 MiB, `folder/disk`; raises PermissionError where nobody may mount one."""
    source, path = folder / "device", folder / "disk"
    source.mkdir()
    path.mkdir()
    try:
        _call("mount", "-t", "tmpfs", "-o", "size=8m", "none", source)
    except (OSError, subprocess.CalledProcessError) as error:
        raise PermissionError("mounting a disk needs the right to mount") from error
    try:
        disk = Disk(path, source)
        disk.plug()
        yield disk
    finally:
        subprocess.run(["umount", "--lazy", path], check=False, capture_output=True)  # noqa: S607 - the system's
        _call("umount", "--lazy", source)


def _call(*words: str | Path) -> None:
    subprocess.run(words, check=True, capture_output=True)


class FailingDisk:
    """What the kernel answers to a write or sync of a flight file, while `error` is not 0; it hangs till `released`."""

    def __init__(self, patch: Patch) -> None:
        self.error = 0
        self.released = threading.Event()
        self.released.set()
        write, sync = DurableFile.write, DurableFile.sync

        def failing_write(file: DurableFile, data: bytes) -> int:
            self._fail(file)
            return write(file, data)

        def failing_sync(file: DurableFile) -> None:
            self._fail(file)
            sync(file)

        patch(DurableFile, "write", failing_write)
        patch(DurableFile, "sync", failing_sync)

    def _fail(self, file: DurableFile) -> None:
        self.released.wait(120)
        if self.error:
            cause = OSError(self.error, errno.errorcode[self.error])
            raise FlightNotWrittenError(file.path, reason="cannot be written") from cause


class TurnedClock:
    """The machine's wall clock, ahead by `ahead_s`."""

    def __init__(self, patch: Patch) -> None:
        self.ahead_s = 0
        read = SystemClock.read

        def turned(clock: SystemClock) -> ClockReading:
            reading = read(clock)
            return replace(reading, realtime_ns=reading.realtime_ns + self.ahead_s * 10**9)

        patch(SystemClock, "read", turned)


def be_harmed() -> None:
    """Be `HARMED`."""
    disk, clock = FailingDisk(setattr), TurnedClock(setattr)

    def obey() -> None:
        for line in sys.stdin:
            what, value = line.split()
            if what == "disk":
                disk.error = int(value)
            else:
                clock.ahead_s = int(value)

    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGTERM, signal.SIGINT))  # as the recorder does in all its threads
    threading.Thread(target=obey, daemon=True).start()
    from recorder.cli import main  # noqa: PLC0415 - what it loads is patched by now

    main()


TAKEN = ("delete", "rename", "replace")
"""How a file can be lost to whoever writes it."""


def take_away(part: Path, how: str) -> None:
    """Let a file in work be lost to its recorder, in one of the ways of `TAKEN`."""
    aside = part.parents[1] / f"{part.name}-{how}d"
    if how == "delete":
        part.unlink()
    elif how == "rename":
        part.rename(aside)
    else:
        aside.write_bytes(b"something else")
        aside.replace(part)


def fill_with_odd_things(directory: Path) -> None:
    """Make a directory of what nobody expects, under names that the recorder looks at."""
    directory.mkdir()
    for number, suffix in enumerate((".mcap", ".mcap.part", ".mcap.keep", ".mcap.sig")):
        own = directory / f"2018050{number + 1}T120000Z_"
        os.mkfifo(f"{own}0000{suffix}")
        Path(f"{own}0001{suffix}").mkdir()
        Path(f"{own}0002{suffix}").symlink_to("/dev/zero")
        Path(f"{own}0003{suffix}").symlink_to(f"{own}0003{suffix}")
        Path(f"{own}0004{suffix}").symlink_to("nowhere")
        Path(f"{own}0005{suffix}").write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 3000)
        Path(f"{own}0006{suffix}").touch(mode=0)
        with Path(f"{own}0007{suffix}").open("wb") as huge:
            huge.truncate(2**42)
    names = [
        b"99991231T235959Z_0000.mcap",
        b"20180504T120000Z_00000000000000000099999.mcap",
        b"20180504T120000Z_" + b"9" * 230 + b".mcap",
        b"20180504T120000Z-" + b"9" * 225 + b"_0000.mcap",
        b"99999999T999999Z_0000.mcap",
        b"00000000T000000Z_0000.mcap.part",
        b"\xff\xfe_0000.mcap",
        b"\xff\xfe_0000.mcap.part",
        b"new\nline_0000.mcap.part",
        "\u0662\u0660\u0661\u0668\u0660\u0665\u0660\u0664T120000Z_0000.mcap".encode(),  # digits, but not ours
    ]
    for name in names:
        with Path(os.fsdecode(os.fsencode(directory) + b"/" + name)).open("wb") as file:
            file.write(b"\x89MCAP0\r\n" + bytes(5000))
