"""The commands in docs/fleet.md run: at home, in an object store, and on a cluster that reads and writes there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from decoder.fleet.outcome import KINDS

DOCUMENT = Path(__file__).parents[2] / "docs" / "fleet.md"
PROGRAMS = Path(sys.executable).parent

Results = Callable[[Path], dict[str, bytes]]
Cluster = Any
Store = Any

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("fleet")]


def run(words: list[str], folder: Path, env: Mapping[str, str]) -> None:
    """A command of ours, to its end."""
    command = [PROGRAMS / words[0], *words[1:]]
    done = subprocess.run(command, cwd=folder, env={**os.environ, **env}, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), words


def test_commands_run(empty_cluster: Cluster, s3: Store, few: Path, results: Results, tmp_path: Path) -> None:
    """From a store into a store, on one machine and on a cluster, it is the same as at home."""
    (tmp_path / "archive").mkdir()
    few.rename(tmp_path / "archive" / "N123")
    (tmp_path / "flights.txt").write_text("archive/N123/flight1_0000.mcap\n")
    s3.fill("flights", tmp_path / "archive", below="2026/")
    text = DOCUMENT.read_text(encoding="utf-8")
    at_home, listed, in_store, on_cluster = map(shlex.split, re.findall(r"^decode fleet .*$", text, re.MULTILINE))
    run(at_home, tmp_path, {})
    run(listed, tmp_path, {})
    empty_cluster.start_worker(env=s3.env)
    on_cluster[-1] = empty_cluster.address
    found = []
    for bucket, words in (("there", on_cluster), ("here", in_store)):
        s3.client.create_bucket(Bucket=bucket)
        run([word.replace("s3://results", f"s3://{bucket}") for word in words], tmp_path, s3.env)
        objects = s3.content(bucket).items()
        found.append({key: content for key, content in objects if not key.endswith((".done", "/index.csv"))})

    assert (tmp_path / "results" / "flight1" / "flight1.parquet").exists()
    assert found[0] == found[1]
    assert {key.removeprefix("2026/"): content for key, content in found[0].items()} == {
        name: content for name, content in results(tmp_path / "results").items() if name.startswith("N123/")
    }


def test_every_column_is_documented() -> None:
    """The table names every column of the index, and no other."""
    rows = re.findall(r"^\| (`.*?) \|", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE)

    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == sorted(KINDS)
