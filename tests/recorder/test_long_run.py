"""Hours of recording on a small disk, and large pictures, measured on a process of its own."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from benchmarks.acceptance import MAX_BOX_MIB, MAX_DAY_GROWTH_MIB, MAX_OPEN_FILES
from benchmarks.box import DAY_RATE_HZ, day, sustained
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.reader import open_flight
from recorder.clock import SystemClock

RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")
MIB_AS_GIB = 1 / 1024
HOURS_S = 8 * 3600  # `make bench` records a day


@pytest.mark.slow
@pytest.mark.untraced
def test_hours_on_a_small_disk(tmp_path: Path, disk: Any) -> None:  # noqa: ANN401 - the conftest's Disk
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


def test_box_listens_on_no_port(tmp_path: Path) -> None:
    """While it drives a camera: it asks, and nobody can ask it."""
    with SimulatedQx10(SystemClock()) as camera:
        config = tmp_path / "recorder.yaml"
        document = {
            "camera": {"driver": "qx10", "url": camera.url},
            "storage": {"directory": str(tmp_path / "flights")},
        }
        config.write_text(yaml.safe_dump(document), encoding="utf-8")
        command = [*RECORDER, "run", "--config", str(config)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as box:
            while not camera.ledger.deliveries and box.poll() is None:
                pass
            listening = listening_sockets(box.pid)
            box.terminate()
        own = listening_sockets_of_tests_own()

    assert box.returncode == 0
    assert listening == []
    assert own


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


def listening_sockets_of_tests_own() -> list[str]:
    """What the search finds in a process that does listen."""
    with socket.create_server(("127.0.0.1", 0)):
        return listening_sockets(os.getpid())
