"""A fleet of small flights, and a dask cluster and an S3 server as processes on loopback."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import boto3
import pytest

from flight_file.frame import Frame
from flight_file.reader import open_flight
from tests.fleet.flights import write_flight
from tests.fleet.watching import kill_whole
from tests.programs import FIXTURES, PROGRAMS, Done, Run, ran, until

FLIGHTS, AIRCRAFT, FRAMES = 12, 4, 4


@pytest.fixture(scope="session")
def frames() -> list[Frame]:
    """The frames of a committed flight."""
    return list(open_flight([FIXTURES / "thesis_a1.mcap"]).frames())


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory, frames: list[Frame]) -> Path:
    """Twelve flights of four frames each, in a folder for each of four aircraft; the first one's have two segments."""
    folder = tmp_path_factory.mktemp("archive")
    for number in range(FLIGHTS):
        chosen = [frames[(number + step) % len(frames)] for step in range(FRAMES)]
        write_flight(
            folder / f"N{number % AIRCRAFT}",
            f"flight{number:02d}",
            chosen,
            per_segment=1000 if number % AIRCRAFT else 2,
        )
    return folder


@pytest.fixture
def few(tmp_path: Path, frames: list[Frame]) -> Path:
    """A folder of three flights that a test may change."""
    for number in range(3):
        write_flight(tmp_path / "few", f"flight{number}", frames[number : number + FRAMES])
    return tmp_path / "few"


@pytest.fixture(scope="session")
def long_flight(tmp_path_factory: pytest.TempPathFactory, frames: list[Frame]) -> Path:
    """A flight that takes seconds to decode, so that something can happen meanwhile."""
    (path,) = write_flight(tmp_path_factory.mktemp("long"), "long", frames * 8)
    return path


@pytest.fixture(scope="session")
def run() -> Run:
    """Runs `decode fleet` to its end."""

    def run_fleet(*words: object, env: Mapping[str, str] | None = None) -> Done:
        return ran("decode", "fleet", *words, env=env)

    return run_fleet


@pytest.fixture(scope="session")
def home(run: Run, archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of these flights, decoded on this machine."""
    output = tmp_path_factory.mktemp("home")
    done = run(f"{archive}/*/*.mcap", "-o", output, "--jobs", "2")
    assert (done.returncode, done.stderr) == (0, "")
    return output


def documented(program: str) -> list[str]:
    """The words of the one command in docs/fleet.md that runs a program."""
    text = (FIXTURES.parent / "docs" / "fleet.md").read_text(encoding="utf-8")
    (line,) = re.findall(rf"^(?:[A-Z_]+=\S+ )?{program} .*$", text, re.MULTILINE)
    return shlex.split(line)


@dataclass
class Cluster:
    """A scheduler and workers, each a process started as docs/fleet.md says."""

    folder: Path
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start(self, *words: str, env: Mapping[str, str] | None = None) -> subprocess.Popen[bytes]:
        """Starts `dask ...`, its words into a file."""
        with (self.folder / f"{len(self.processes)}.log").open("wb") as log:
            self.processes.append(
                subprocess.Popen(
                    [str(PROGRAMS / "dask"), *words], stdout=log, stderr=log, env={**os.environ, **(env or {})}
                )
            )
        return self.processes[-1]

    def start_scheduler(self) -> None:
        """As docs/fleet.md says, on any free port."""
        file = self.folder / "scheduler.json"
        setting, _, *words = documented("dask scheduler")
        words[words.index("8786")] = "0"
        self.start(
            *(*words, "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)),
            env=dict([setting.split("=")]),
        )
        until(lambda: file.exists() and file.read_text(encoding="utf-8").endswith("}"))

    def start_worker(self, *, env: Mapping[str, str] | None = None) -> subprocess.Popen[bytes]:
        """As docs/fleet.md says."""
        _, *words = documented("dask worker")
        words[words.index("tcp://scheduler:8786")] = self.address
        place = str(self.folder)
        return self.start(*words, "--host", "127.0.0.1", "--no-dashboard", "--local-directory", place, env=env)

    @property
    def address(self) -> str:
        """The scheduler's."""
        address: str = json.loads((self.folder / "scheduler.json").read_text(encoding="utf-8"))["address"]
        return address

    def stop(self) -> None:
        """Ends all that is left of it."""
        for process in reversed(self.processes):
            kill_whole(process)


@pytest.fixture
def empty_cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler without workers."""
    cluster = Cluster(tmp_path)
    try:
        cluster.start_scheduler()
        yield cluster
    finally:
        cluster.stop()


@pytest.fixture
def cluster(empty_cluster: Cluster) -> Cluster:
    """A scheduler and two workers."""
    empty_cluster.start_worker()
    empty_cluster.start_worker()
    return empty_cluster


@dataclass(frozen=True)
class Store:
    """An S3 server on loopback."""

    client: Any
    env: Mapping[str, str]

    def fill(self, bucket: str, folder: Path, *, below: str = "") -> None:
        """Copies a folder into a new bucket."""
        self.client.create_bucket(Bucket=bucket)
        for path in folder.rglob("*"):
            if path.is_file():
                self.client.upload_file(str(path), bucket, below + str(path.relative_to(folder)))

    def content(self, bucket: str) -> dict[str, bytes]:
        """All objects of a bucket."""
        listed = self.client.list_objects_v2(Bucket=bucket).get("Contents", [])
        return {each["Key"]: self.client.get_object(Bucket=bucket, Key=each["Key"])["Body"].read() for each in listed}


@pytest.fixture(scope="session")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """A real S3 server: moto's, as a process of its own; each test has its own buckets."""
    log = tmp_path_factory.mktemp("s3") / "s3.log"
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [str(PROGRAMS / "moto_server"), "-H", "127.0.0.1", "-p", "0"], stdout=stream, stderr=stream
        )
    try:
        (address,) = until(lambda: re.findall(r"Running on (http://[0-9.:]+)", log.read_text(encoding="utf-8")))
        env = {
            "AWS_ENDPOINT_URL": address,
            "AWS_ACCESS_KEY_ID": "tests",
            "AWS_SECRET_ACCESS_KEY": "tests",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        client = boto3.client(
            "s3",
            endpoint_url=address,
            aws_access_key_id="tests",
            aws_secret_access_key="tests",  # noqa: S106 - of a server that takes any
            region_name="us-east-1",
        )
        yield Store(client, env)
        client.close()
    finally:
        kill_whole(process)
