"""A fleet on a dask cluster of real processes: the same bytes as at home, whoever dies and whatever is damaged."""

from __future__ import annotations

import asyncio
import gc
import shutil
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from decoder.parallel.cluster_workers import ClusterWorkers
from decoder.parallel.decoding import decode_one
from tests.fleet.watching import find_reader, kill_whole, results, started, states
from tests.programs import ROOT, Run, until

Cluster = Any

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("fleet")]


@pytest.mark.untraced
def test_killed_worker_and_corrupt_flight(cluster: Cluster, archive: Path, home: Path, tmp_path: Path) -> None:
    """Twelve flights and a corrupt one, one of two workers killed meanwhile: the bytes of home, one failure told."""
    corrupt = tmp_path / "corrupt.mcap"
    corrupt.write_bytes(bytes(range(256)) * 100)
    output = tmp_path / "out"
    running = started(f"{archive}/*/*.mcap", corrupt, "-o", output, "--scheduler", cluster.address)
    until(lambda: len(list(output.glob("*/*/fleet.done"))) >= 3)
    kill_whole(cluster.processes[1])
    _, words = running.communicate(timeout=120)

    assert running.returncode == 1
    assert words.startswith("failed: corrupt: ")
    assert "is not an MCAP file" in words
    assert len(words.splitlines()) == 1
    assert results(output) == results(home)
    assert {flight for flight, status in states(output).items() if status == "failed"} == {"corrupt"}


def test_other_code_is_refused(empty_cluster: Cluster, run: Run, few: Path, tmp_path: Path) -> None:
    """A worker whose checkout differs by a remark is named, in one sentence, and nothing is decoded."""
    for package in ("decoder", "flight_file"):
        shutil.copytree(ROOT / package, tmp_path / "other" / package)
    with (tmp_path / "other" / "decoder" / "start.py").open("a", encoding="utf-8") as stream:
        stream.write("# changed\n")
    empty_cluster.start_worker(env={"PYTHONPATH": str(tmp_path / "other")})
    done = run(f"{few}/*.mcap", "-o", tmp_path / "out", "--scheduler", empty_cluster.address)

    assert done.returncode == 1
    assert done.stderr.startswith("decode: the worker tcp://127.0.0.1:")
    assert "install the same on both" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list((tmp_path / "out").iterdir()) == [tmp_path / "out" / "index.csv"]


def test_loop_that_stops_while_its_sender_waits(cluster: Cluster, caplog: pytest.LogCaptureFixture) -> None:
    """A future of the client's own that timed out as its loop stopped is no word to the user."""

    async def time_out() -> None:
        asyncio.get_running_loop().create_future().set_exception(TimeoutError("Timeout"))

    with ClusterWorkers(cluster.address, decode_one) as workers:
        workers._client.sync(time_out)
    gc.collect()

    assert [record.message for record in caplog.records if record.name == "asyncio"] == []


def test_no_scheduler_and_no_workers(empty_cluster: Cluster, run: Run, few: Path, tmp_path: Path) -> None:
    """An address without a scheduler and a scheduler without workers are told with what to start; exit code 1."""
    words = [f"{few}/*.mcap", "-o", tmp_path / "out", "--scheduler"]
    with ThreadPoolExecutor() as pool:
        addresses = (empty_cluster.address, "tcp://127.0.0.1:9", "carrier-pigeon")
        nobody, nowhere, unheard = pool.map(lambda address: run(*words, address), addresses)

    for done, told in (
        (nobody, "start some with `dask worker tcp://"),
        (nowhere, "tcp://127.0.0.1:9: there is no scheduler; start one with `dask scheduler`"),
        (unheard, "carrier-pigeon: there is no scheduler"),
    ):
        assert done.returncode == 1
        assert done.stderr.startswith("decode: ")
        assert told in done.stderr
        assert len(done.stderr.splitlines()) == 1


@pytest.mark.untraced
def test_interrupt_leaves_workers_their_flight(cluster: Cluster, few: Path, long_flight: Path, tmp_path: Path) -> None:
    """Ctrl-C ends the client; the flight that a worker holds is finished, and whole. A lost scheduler ends it, too."""
    flight, output = Path(shutil.copy(long_flight, few / "long.mcap")), tmp_path / "out"
    words = [f"{few}/*.mcap", "-o", output, "--scheduler", cluster.address]
    nannies = [process.pid for process in cluster.processes[1:]]

    running = started(*words)
    until(lambda: find_reader(flight, *nannies))
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=120)
    assert (running.returncode, told) == (1, "decode: interrupted; finished flights are kept by the next run\n")
    until((output / "long" / "fleet.done").exists)
    assert {path.name for path in (output / "long").iterdir()} == {
        *("fleet.done", "long.csv", "long.json", "long_alignment.tsv")
    }

    running = started(*words, "--method", "xcorr")
    until(lambda: find_reader(flight, *nannies))
    kill_whole(cluster.processes[0])
    _, told = running.communicate(timeout=120)
    assert running.returncode == 1
    assert told.startswith("decode: ")
    assert "the scheduler was lost; start it and run the same command again" in told
    assert len(told.splitlines()) == 1
