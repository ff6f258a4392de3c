"""The whole box in processes of its own: with every fault of the camera, for hours, and killed at random moments."""

from __future__ import annotations

import io
import os
import signal
import socket
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.acceptance import (
    MAX_BOX_MIB,
    MAX_CALLS_FILES,
    MAX_DAY_GROWTH_MIB,
    MAX_OPEN_FILES,
    MAX_THREADS,
)
from benchmarks.box import DAY_RATE_HZ, called, day, sustained
from benchmarks.harm import LIMITS, QUICK, Disk, order_all_faults
from benchmarks.kills import kills
from camera_drivers.qx10.simulator.faults import FAULTS
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.reader import open_flight
from flight_file.verification import Verdict, verify
from recorder.config import RecorderConfig, parse_config
from recorder.host import SystemClock, this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.supervision import Stop
from tests.programs import begun, until, write_yaml
from tests.recorder.helpers import messages

PATIENCE_S = 120
MIB_AS_GIB = 1 / 1024
HOURS_S = 4 * 3600  # `make bench` records a day
COUNT = 5  # `make kills` does 200
STILLS = 1000
MAX_KEPT_KIB = 4.0  # by a still


def configuration(url: str, directory: Path) -> RecorderConfig:
    """A box that takes pictures as fast as it can."""
    return parse_config(
        {
            "camera": {"driver": "qx10", "url": url, "interval_s": 0, "limits": LIMITS},
            "storage": {"directory": str(directory), "segment_s": 3, "keep_free_gib": 0},
        }
    )


def record_until(condition: Callable[[], bool], config: RecorderConfig) -> Outcome:
    """Record in a thread until it holds."""
    stop, over = Stop(), Future[Outcome]()
    journal = Journal(io.StringIO())
    threading.Thread(
        target=lambda: over.set_result(record(config, host=this_host(), stop=stop, journal=journal)), daemon=True
    ).start()
    until(condition)
    stop.request("the flight is over")
    return over.result(PATIENCE_S)


@pytest.mark.slow
def test_every_fault_once_and_every_picture_accounted_for(tmp_path: Path) -> None:
    """Each picture that was delivered is in the flight once, byte for byte; each other one with its reason."""
    with SimulatedQx10(SystemClock(), behaviour=QUICK) as camera:
        shots = order_all_faults(camera)
        outcome = record_until(lambda: len(camera.ledger.taken) >= shots, configuration(camera.url, tmp_path))
        delivered = camera.ledger.delivered()
    frames = list(open_flight(outcome.paths).frames())
    stored = [frame.sha256 for frame in frames]
    missing = set(range(frames[-1].sequence + 1)) - {frame.sequence for frame in frames}
    said = messages("/camera/status", *outcome.paths)
    (check,) = verify(outcome.paths)

    # The box may have been stopped while a last picture was on its way.
    assert stored in (delivered, delivered[:-1])
    assert len(stored) > len(FAULTS)
    assert len(missing) > 0
    assert outcome.dropped - len(missing) in {0, 1}
    counts = next(entry["reason"] for entry in reversed(said) if entry["reason"].startswith("dropped: "))
    assert sum(int(word) for word in counts.split() if word.isdigit()) == outcome.dropped
    assert {"connecting", "capturing", "lost", "refused", "finished"} <= {entry["state"] for entry in said}
    assert check.verdict is not Verdict.FAULT


def started(camera: SimulatedQx10, folder: Path) -> subprocess.Popen[str]:
    """A box of its own that records from a camera; it comes back when the camera has delivered two pictures."""
    document = {
        "camera": {"driver": "qx10", "url": camera.url, "interval_s": 0},
        "storage": {"directory": "flights", "keep_free_gib": 0},
    }
    write_yaml(folder / "recorder.yaml", document)
    box = begun("recorder", "run", "--config", folder / "recorder.yaml")
    until(lambda: len(camera.ledger.deliveries) >= 2 or box.poll() is not None)
    return box


def test_camera_that_falls_silent_does_not_hold_up_the_end(tmp_path: Path) -> None:
    """SIGTERM while a call waits for an answer: the process ends by itself, with a finished file that says why."""
    with SimulatedQx10(SystemClock(), behaviour=replace(QUICK, silent_s=PATIENCE_S)) as camera:
        camera.fault_schedule.order("silent", at=3)
        box = started(camera, tmp_path)
        box.send_signal(signal.SIGHUP)
        box.send_signal(signal.SIGTERM)
        printed, log = box.communicate(timeout=60)
    (path,) = map(Path, printed.splitlines())
    end = open_flight([path]).segments[-1].end

    assert box.returncode == 0, log
    assert end is not None
    assert end.reason.startswith("stopped by SIGTERM")
    assert list((tmp_path / "flights").glob("*.mcap*")) == [path]


@pytest.mark.slow
@pytest.mark.untraced
def test_hours_on_a_small_disk(tmp_path: Path, disk: Disk) -> None:
    """Memory stays, files are closed, nothing is dropped, and what is kept is the newest without a gap."""
    flights = disk.path / "flights"
    result = day(tmp_path, flights, seconds=HOURS_S, keep_hours=0.5, keep_free_gib=2 * MIB_AS_GIB)
    frames = list(open_flight(result.segments).frames())
    last = round(HOURS_S * DAY_RATE_HZ) - 1

    assert (result.stored, result.dropped) == (last + 1, 0)
    assert result.growth_mib() <= MAX_DAY_GROWTH_MIB
    assert result.most_files() <= MAX_OPEN_FILES
    assert [frame.sequence for frame in frames] == list(range(last + 1 - len(frames), last + 1))
    assert len(frames) / DAY_RATE_HZ >= 0.5 * 3600
    assert {path.suffix for path in result.segments} == {".mcap"}


@pytest.mark.slow
@pytest.mark.untraced
def test_large_pictures_fit_a_small_board() -> None:
    """Pictures of 5 MB, as fast as the disk takes them: at most 120 MB, none lost, and no OpenCV."""
    result = sustained(40, pace="fastest")

    assert (result.stored, result.dropped) == (40, 0)
    assert result.peak_mib <= MAX_BOX_MIB
    assert not result.loads_opencv


@pytest.mark.slow
@pytest.mark.untraced
def test_calls_to_a_camera_leave_nothing_behind() -> None:
    """Some five thousand, for 1000 stills: no still keeps 4 KiB of memory, and files and threads are few."""
    result = called(STILLS)

    # A machine that becomes idle meanwhile lets the box take more stills at once, and hold some MiB more of them.
    assert result.growth_mib() <= STILLS * MAX_KEPT_KIB / 1024
    assert max(each.files for _, each in result.settled) <= MAX_CALLS_FILES
    assert max(each.threads for _, each in result.settled) <= MAX_THREADS


def test_box_listens_on_no_port(tmp_path: Path) -> None:
    """While it drives a camera: it asks, and nobody can ask it."""
    with SimulatedQx10(SystemClock(), behaviour=QUICK) as camera, started(camera, tmp_path) as box:
        listening = listening_sockets(box.pid)
        box.send_signal(signal.SIGTERM)
        box.communicate(timeout=60)
    with socket.create_server(("127.0.0.1", 0)):
        own = listening_sockets(os.getpid())

    assert box.returncode == 0
    assert listening == []
    assert own  # the search does find something in a process that listens


def listening_sockets(pid: int) -> list[str]:
    """Inodes of the sockets of a process on which others may reach it: listening ones, and UDP without a peer."""
    links = [link.readlink() for link in Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()]
    own = {str(link)[8:-1] for link in links if str(link).startswith("socket:")}
    states = {"tcp": "0A", "tcp6": "0A", "udp": "07", "udp6": "07"}
    found = []
    for name, state in states.items():
        table = Path(f"/proc/{pid}/net/{name}")
        rows = [line.split() for line in table.read_text("ascii").splitlines()[1:]] if table.exists() else []
        found += [row[9] for row in rows if row[3] == state and row[9] in own]
    return found


@pytest.mark.slow
@pytest.mark.untraced
def test_killed_recorder_loses_nothing_stored() -> None:
    """Every frame that it had said was stored is there after recovering, byte for byte; the chain fits."""
    done = kills(COUNT)

    assert [kill for kill in done if kill.kept.faults] == []
    assert sum(kill.kept.said > 0 for kill in done) >= COUNT // 5
