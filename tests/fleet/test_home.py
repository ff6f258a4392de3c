"""A fleet on this machine's processes: the same as one by one, and whatever is killed, nothing is half-written."""

from __future__ import annotations

import csv
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

DECODE = Path(sys.executable).parent / "decode"
FLIGHTS = 50
PATIENCE_S = 120

Run = Callable[..., subprocess.CompletedProcess[str]]
Results = Callable[[Path], dict[str, bytes]]
WaitUntil = Callable[[Callable[[], Any]], Any]
FindReader = Callable[[Path, int], Any]
IsGone = Callable[[Any], bool]
Running = Any

pytestmark = pytest.mark.xdist_group("fleet")


def index(output: Path) -> dict[str, dict[str, str]]:
    """The rows of an output's index, by flight."""
    with (output / "index.csv").open(encoding="utf-8", newline="") as stream:
        return {row["flight"]: row for row in csv.DictReader(stream)}


def states(output: Path) -> dict[str, str]:
    """The status of each flight in an output's index."""
    return {flight: row["status"] for flight, row in index(output).items()}


def test_results_are_those_of_decode(home: Path, archive: Path, results: Results, tmp_path: Path) -> None:
    """What `decode` writes of a flight, of one file or two segments, is what the fleet writes, byte for byte."""
    for place in ("N1/flight01", "N0/flight10"):
        flight = sorted(archive.glob(f"{place}_*.mcap"))
        subprocess.run([DECODE, *flight, "-o", tmp_path / place], check=True, capture_output=True)

        assert {f"{place}/{name}": content for name, content in results(tmp_path / place).items()} == {
            name: content for name, content in results(home).items() if name.startswith(f"{place}/")
        }


def test_index_has_a_row_for_every_flight(home: Path) -> None:
    """Fifty rows, sorted by name, with what was read of each."""
    rows = index(home)

    assert len(rows) == FLIGHTS
    assert list(rows) == sorted(rows)
    assert rows["N0/flight10"]["flight_files"].count(" | ") == 1
    for row in rows.values():
        assert (row["status"], row["frames"], row["missing"]) == ("decoded", "4", "0")
        assert sum(int(row[status]) for status in ("read", "edge", "hidden", "interpolated")) == 4 * 7


def test_failures_stop_nobody(run: Run, few: Path, results: Results, tmp_path: Path) -> None:
    """A flight that is no MCAP, two that are not there and one without its index are told; the others are whole."""
    (few / "gone.mcap").symlink_to(few / "archived" / "gone.mcap")
    (few / "letter.mcap").write_text("Dear Sir or Madam, " * 100)
    (few / "cut.mcap").write_bytes((few / "flight2_0000.mcap").read_bytes()[:-2000])
    done = run(f"{few}/*.mcap", few / "no.mcap", "-o", tmp_path / "out")
    rows = index(tmp_path / "out")

    assert done.returncode == 1
    assert {flight for flight, row in rows.items() if row["status"] == "failed"} == {"gone", "letter", "no"}
    assert "is not an MCAP file" in rows["letter"]["reason"]
    assert all("there is no such file" in rows[name]["reason"] for name in ("gone", "no"))
    assert rows["cut"]["losses"]
    assert sorted(line.split(":")[1].strip() for line in done.stderr.splitlines()) == ["gone", "letter", "no"]
    assert {flight for flight, row in rows.items() if row["status"] == "decoded"} == {
        *("cut", "flight0", "flight1", "flight2")
    }
    assert set(results(tmp_path / "out" / "flight1")) == {"flight1.csv", "flight1.json", "flight1_alignment.tsv"}
    assert not (tmp_path / "out" / "letter").exists()
    assert run(few / "cut.mcap", "-o", tmp_path / "out", "--jobs", "1").returncode == 3


@pytest.fixture
def running(few: Path, long_flight: Path, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A fleet in work: three short flights and a long one, its temporary files in a folder of their own."""
    shutil.copy(long_flight, few / "long.mcap")
    (tmp_path / "tmp").mkdir()
    command = [DECODE, "fleet", f"{few}/*.mcap", "-o", tmp_path / "out", "--jobs", "2"]
    env = {**os.environ, "TMPDIR": str(tmp_path / "tmp")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env) as process:
        yield process
        if process.poll() is None:
            process.kill()


@pytest.mark.untraced
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_leaves_nothing_half_written(
    running: Running,
    number: int,
    few: Path,
    find_reader: FindReader,
    wait_until: WaitUntil,
    is_gone: IsGone,
    tmp_path: Path,
) -> None:
    """Ctrl-C ends it and its processes; whole results stay, nothing else."""
    worker = wait_until(lambda: find_reader(few / "long.mcap", running.pid))
    running.send_signal(number)
    _, words = running.communicate(timeout=PATIENCE_S)

    assert running.returncode == 1
    assert words == "decode: interrupted; finished flights are kept by the next run\n"
    assert is_gone(worker)
    assert list((tmp_path / "tmp").iterdir()) == []
    assert list((tmp_path / "out").rglob(".*")) == []
    assert not (tmp_path / "out" / "long").exists()
    assert set(states(tmp_path / "out")) <= {path.parent.name for path in (tmp_path / "out").glob("*/fleet.done")}


def test_killed_worker_takes_no_flight_along(
    running: Running, few: Path, find_reader: FindReader, wait_until: WaitUntil, tmp_path: Path
) -> None:
    """A flight whose worker is killed is decoded again by another one."""
    wait_until(lambda: find_reader(few / "long.mcap", running.pid)).kill()
    _, words = running.communicate(timeout=PATIENCE_S)

    assert (running.returncode, words) == (0, "")
    assert "failed" not in states(tmp_path / "out").values()
    assert {path.parent.name for path in (tmp_path / "out").glob("*/fleet.done")} == {
        *("flight0", "flight1", "flight2", "long")
    }


def test_flight_that_kills_its_workers_is_told(
    running: Running, few: Path, find_reader: FindReader, wait_until: WaitUntil, is_gone: IsGone, tmp_path: Path
) -> None:
    """A flight whose worker is killed twice is given up; the others are decoded."""
    for _ in range(2):
        worker = wait_until(lambda: find_reader(few / "long.mcap", running.pid))
        worker.kill()
        wait_until(lambda worker=worker: is_gone(worker))
    _, words = running.communicate(timeout=PATIENCE_S)

    assert running.returncode == 1
    assert words.startswith("failed: long: its worker was killed 2 times over it")
    assert states(tmp_path / "out") == {**dict.fromkeys(["flight0", "flight1", "flight2"], "decoded"), "long": "failed"}


def test_processes_do_not_outlive_their_fleet(
    running: Running, few: Path, find_reader: FindReader, wait_until: WaitUntil, is_gone: IsGone, tmp_path: Path
) -> None:
    """If the program itself is killed, its processes end and take what they had begun along."""
    worker = wait_until(lambda: find_reader(few / "long.mcap", running.pid))
    running.kill()
    wait_until(lambda: is_gone(worker))

    assert not (tmp_path / "out" / "long").exists()
    assert list((tmp_path / "out").rglob(".*")) == []
    assert list((tmp_path / "tmp").glob(f"fleet-*-{worker.pid}-*")) == []
