"""A fleet on this machine's processes: the same results as one by one, and nothing half-written, whatever is killed."""

from __future__ import annotations

import shutil
import signal
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.fleet.watching import find_reader, index, is_gone, results, states
from tests.programs import PATIENCE_S, Run, begun, ran, until

FLIGHTS = 12

Running = Any

pytestmark = pytest.mark.xdist_group("fleet")


def test_results_are_those_of_decode(home: Path, archive: Path, tmp_path: Path) -> None:
    """What `decode` writes of a flight, of one file or two segments, is what the fleet writes, byte for byte."""
    for place in ("N1/flight01", "N0/flight08"):
        flight = sorted(archive.glob(f"{place}_*.mcap"))
        assert ran("decode", *flight, "-o", tmp_path / place).returncode == 0

        assert {f"{place}/{name}": content for name, content in results(tmp_path / place).items()} == {
            name: content for name, content in results(home).items() if name.startswith(f"{place}/")
        }


def test_index_has_a_row_for_every_flight(home: Path) -> None:
    """Twelve rows, sorted by name, with what was read of each."""
    rows = index(home)

    assert len(rows) == FLIGHTS
    assert list(rows) == sorted(rows)
    assert rows["N0/flight08"]["flight_files"].count(" | ") == 1
    for row in rows.values():
        assert (row["status"], row["frames"], row["missing"]) == ("decoded", "4", "0")
        assert sum(int(row[status]) for status in ("read", "edge", "hidden", "interpolated")) == 4 * 7


def test_failures_stop_nobody(run: Run, few: Path, tmp_path: Path) -> None:
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
    words = ("fleet", f"{few}/*.mcap", "-o", tmp_path / "out", "--jobs", "2")
    with begun("decode", *words, env={"TMPDIR": str(tmp_path / "tmp")}) as process:
        yield process
        if process.poll() is None:
            process.kill()


@pytest.mark.untraced
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_leaves_nothing_half_written(running: Running, number: int, few: Path, tmp_path: Path) -> None:
    """Ctrl-C ends it and its processes; whole results stay, nothing else."""
    worker = until(lambda: find_reader(few / "long.mcap", running.pid))
    running.send_signal(number)
    _, words = running.communicate(timeout=PATIENCE_S)

    assert running.returncode == 1
    assert words == "decode: interrupted; finished flights are kept by the next run\n"
    assert is_gone(worker)
    assert list((tmp_path / "tmp").iterdir()) == []
    assert list((tmp_path / "out").rglob(".*")) == []
    assert not (tmp_path / "out" / "long").exists()
    assert set(states(tmp_path / "out")) <= {path.parent.name for path in (tmp_path / "out").glob("*/fleet.done")}


def test_flight_that_kills_its_workers_is_told(running: Running, few: Path, tmp_path: Path) -> None:
    """A flight whose worker is killed twice is given up; the others are decoded."""
    for _ in range(2):
        worker = until(lambda: find_reader(few / "long.mcap", running.pid))
        worker.kill()
        until(partial(is_gone, worker))
    _, words = running.communicate(timeout=PATIENCE_S)

    assert running.returncode == 1
    assert words.startswith("failed: long: its worker was killed 2 times over it")
    assert states(tmp_path / "out") == {**dict.fromkeys(["flight0", "flight1", "flight2"], "decoded"), "long": "failed"}


def test_processes_do_not_outlive_their_fleet(running: Running, few: Path, tmp_path: Path) -> None:
    """If the program itself is killed, its processes end and take what they had begun along."""
    worker = until(lambda: find_reader(few / "long.mcap", running.pid))
    running.kill()
    until(lambda: is_gone(worker))

    assert not (tmp_path / "out" / "long").exists()
    assert list((tmp_path / "out").rglob(".*")) == []
    assert list((tmp_path / "tmp").glob(f"fleet-*-{worker.pid}-*")) == []
