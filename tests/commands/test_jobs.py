"""`decode --jobs N`: the same bytes with any number of processes, whoever is killed, and none of them left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from decoder.parallel.processes import jobs_for, usable_cores
from decoder.parallel.thresholds import MIN_SHARED_BYTES
from tests.programs import A2, MakeFlight, begun, contents, ran

pytestmark = pytest.mark.untraced  # tests/workers goes through the same lines


@pytest.fixture
def long_flight(make_flight: MakeFlight, pictures: list[bytes]) -> Path:
    """A flight of 120 frames."""
    return make_flight(pictures * 6)


def processes() -> Iterator[tuple[int, int]]:
    """Every process that runs, with its parent."""
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = status.read_text(encoding="utf-8").rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if state != "Z":
            yield int(status.parent.name), int(parent)


def below(pid: int) -> set[int]:
    """The processes that a process has started, and those that they have."""
    children = {child for child, parent in processes() if parent == pid}
    return children.union(*(below(child) for child in children))


def wait_for_workers(running: subprocess.Popen[str]) -> tuple[set[int], set[int]]:
    """The workers of a decode, once it has some, and all that it has started."""
    while running.poll() is None:
        own = {child for child, parent in processes() if parent == running.pid}
        workers = {child for child, parent in processes() if parent in own}
        if workers:
            return workers, own | workers
        time.sleep(0.01)
    raise AssertionError(running.communicate())


def started(*words: object) -> subprocess.Popen[str]:
    """A decode in a process group of its own, as a shell starts it."""
    return begun("decode", *words, process_group=0)


@pytest.mark.slow
def test_bytes_are_the_same_with_any_number_of_processes(tmp_path: Path) -> None:
    """With one, two or three of them every file is the same, byte for byte."""
    for count in (1, 2, 3):
        done = ran("decode", A2, "-o", tmp_path / str(count), "--jobs", count)
        assert (done.returncode, done.stderr) == (0, "")

    assert len(contents(tmp_path / "1")) == 3
    assert contents(tmp_path / "1") == contents(tmp_path / "2") == contents(tmp_path / "3")


def test_killed_worker_is_reported_and_costs_nothing(long_flight: Path, tmp_path: Path) -> None:
    """Its frames are read again; tests/workers hold that they are those of an undisturbed decode, to the bit."""
    with started(long_flight, "-o", tmp_path / "out", "--jobs", 2) as running:
        workers, _ = wait_for_workers(running)
        os.kill(workers.pop(), signal.SIGKILL)
        _, said = running.communicate(timeout=60)

    assert running.returncode == 0, said
    assert "was killed (SIGKILL); its frames were read again" in said
    assert (tmp_path / "out" / "flight.csv").read_text(encoding="utf-8").count("\n") == 121


def wait_until_gone(pids: set[int]) -> None:
    """The last processes of a decode go when they notice that nobody is there any more."""
    deadline = time.monotonic() + 20
    while (left := pids & {pid for pid, _ in processes()}) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert left == set()


def test_interrupt_ends_every_process(long_flight: Path, tmp_path: Path) -> None:
    """Ctrl-C reaches all of a terminal's processes: one sentence, none of them left, no file begun."""
    with started(long_flight, "-o", tmp_path / "out", "--jobs", 2) as running:
        _, everyone = wait_for_workers(running)
        os.killpg(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=60)

    assert (running.returncode, said.strip()) == (1, "decode: interrupted; nothing was written")
    wait_until_gone(everyone)
    assert not (tmp_path / "out").exists()


def test_decode_that_is_killed_leaves_no_process(long_flight: Path, tmp_path: Path) -> None:
    """Workers end by themselves when nobody is there to give them frames."""
    with started(long_flight, "-o", tmp_path / "out", "--jobs", 2) as running:
        _, everyone = wait_for_workers(running)
        running.kill()
        running.communicate(timeout=60)

    wait_until_gone(everyone)


@pytest.mark.parametrize(
    ("quota", "cores"), [("max 100000", 99), ("150000 100000", 1), ("50000 100000", 1), ("300000 100000", 3)]
)
def test_cores_are_those_that_may_be_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, quota: str, cores: int
) -> None:
    """A control group's quota counts as the affinity does; where there is none, the affinity alone."""
    monkeypatch.setattr("decoder.parallel.processes.CPU_QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(6)))
    assert usable_cores() == 6
    (tmp_path / "cpu.max").write_text(quota)
    assert usable_cores() == min(cores, 6)


def test_short_flight_is_read_by_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless somebody asks for more; a long one by as many as there are cores, up to eight."""
    monkeypatch.setattr("decoder.parallel.processes.usable_cores", lambda: 64)

    assert jobs_for(MIN_SHARED_BYTES - 1, asked=None) == 1
    assert jobs_for(MIN_SHARED_BYTES - 1, asked=3) == 3
    assert jobs_for(MIN_SHARED_BYTES, asked=None) == 8
    assert jobs_for(MIN_SHARED_BYTES, asked=1) == 1


def test_a_long_path_of_temporary_files_keeps_nobody_from_working(tmp_path: Path) -> None:
    """Processes talk over a socket, whose path may not be longer than some hundred bytes."""
    folder = tmp_path / ("long" * 20) / ("longer" * 10)
    folder.mkdir(parents=True)
    done = ran("decode", A2, "-o", tmp_path / "out", "--jobs", "2", env={"TMPDIR": str(folder)})

    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "thesis_a2.csv").exists()
    assert list(folder.iterdir()) == []
