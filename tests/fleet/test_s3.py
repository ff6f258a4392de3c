"""Flights and results in an object store, a real server on loopback; the commands in docs/fleet.md, which use it."""

from __future__ import annotations

import csv
import io
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from decoder.parallel.index import KINDS
from tests.fleet.watching import results
from tests.programs import FIXTURES, Run, ran

Store = Any

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("fleet")]


def without_marks(objects: dict[str, bytes]) -> dict[str, bytes]:
    """The results among a bucket's objects."""
    return {
        key: content
        for key, content in objects.items()
        if not key.endswith(("fleet.done", "index.csv")) and ".inputs/" not in key
    }


def test_from_store_to_store(s3: Store, run: Run, archive: Path, home: Path) -> None:
    """Flights of a bucket into another one are the bytes of home; a second run keeps them, a new version is decoded."""
    s3.fill("archive", archive / "N0")
    s3.client.create_bucket(Bucket="results")
    words = ["s3://archive/*.mcap", "-o", "s3://results/2026", "--jobs", "2"]
    first = run(*words, env=s3.env)
    objects = s3.content("results")
    flight = "flight08_0001.mcap"
    s3.client.upload_file(str(archive / "N0" / "flight04_0001.mcap"), "archive", flight)
    second = run(*words, env=s3.env)
    rows = list(csv.DictReader(io.StringIO(s3.content("results")["2026/index.csv"].decode())))

    assert (first.returncode, first.stderr) == (0, "")
    assert without_marks(objects) == {
        "2026" + name.removeprefix("N0"): content for name, content in results(home).items() if name.startswith("N0/")
    }
    assert second.returncode == 1
    assert {row["flight"]: row["status"] for row in rows} == {
        **dict.fromkeys(["flight00", "flight04"], "kept"),
        "flight08": "failed",
    }
    assert f"s3://archive/{flight} belong to different recordings" in second.stderr


def test_list_and_panel_in_a_store(s3: Store, run: Run, few: Path, tmp_path: Path) -> None:
    """A list, its flights and a panel may lie in a bucket; flights are named relative to the list."""
    (few / "panel.yaml").write_bytes((FIXTURES / "panel.yaml").read_bytes())
    (few / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
    (few / "flights.txt").write_text("# two of three\nflight0_0000.mcap\n\nflight1_*.mcap\n")
    s3.fill("fleet", few)
    words = ["--panel", "s3://fleet/panel.yaml", "--jobs", "1"]
    done = run("@s3://fleet/flights.txt", "-o", tmp_path / "out", *words, env=s3.env)
    run(f"@{few}/flights.txt", "-o", tmp_path / "local", "--panel", few / "panel.yaml", "--jobs", "1")

    assert (done.returncode, done.stderr) == (0, "")
    assert results(tmp_path / "out") == results(tmp_path / "local")
    assert {path.name for path in (tmp_path / "out").glob("flight*")} == {"flight0", "flight1"}


def test_store_that_does_not_give_or_take(s3: Store, run: Run, few: Path, tmp_path: Path) -> None:
    """Buckets that are not there and rights that are not given are one sentence with the address."""
    flight = few / "flight0_0000.mcap"
    for words, told in (
        (["s3://nobody/*.mcap", "-o", tmp_path / "out"], "s3://nobody/*.mcap: no flight file"),
        ([flight, "-o", "s3://nobody/out"], "s3://nobody/out/index.csv: cannot be written"),
        (["@s3://nobody/list.txt", "-o", tmp_path / "out"], "s3://nobody/list.txt: there is no such list"),
        (
            [flight, "-o", tmp_path / "out", "--panel", "s3://nobody/panel.yaml"],
            "s3://nobody/panel.yaml: cannot be read",
        ),
    ):
        done = run(*words, env=s3.env)
        assert done.returncode == 1
        assert done.stderr.startswith(f"decode: {told}"), done.stderr
        assert len(done.stderr.splitlines()) == 1


DOCUMENT = Path(__file__).parents[2] / "docs" / "fleet.md"

Cluster = Any


def run(words: list[str], folder: Path, env: Mapping[str, str]) -> None:
    """A command of ours, to its end."""
    done = ran(*words, cwd=folder, env=env)
    assert (done.returncode, done.stderr) == (0, ""), words


@pytest.mark.untraced
def test_commands_run(empty_cluster: Cluster, s3: Store, few: Path, tmp_path: Path) -> None:
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
