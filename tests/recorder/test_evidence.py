"""`recorder recover`, `verify`, `mark` and `keygen` as their users run them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight_file.frame import ClockReading
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus
from flight_file.session import Session
from flight_file.writer import SegmentWriter

WriteConfig = Callable[..., Path]
Result = subprocess.CompletedProcess[str]
RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")


def recorder(*arguments: str | Path) -> Result:
    """Run a command to its end."""
    return subprocess.run([*RECORDER, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """A key made by the command."""
    path = tmp_path / "recorder.key"
    assert recorder("keygen", path).stdout == f"private key: {path}\npublic key:  {path}.pub\n"
    return path


@pytest.fixture
def flight(write_config: WriteConfig, key: Path) -> list[Path]:
    """A signed flight of three segments."""
    config = write_config(storage={"segment_s": 4}, evidence={"key": key.name})
    return [Path(line) for line in recorder("run", "--config", config).stdout.splitlines()]


def test_recorded_flight_fits_and_says_who_signed(flight: list[Path], key: Path) -> None:
    """One line for each segment, one for the recording; the same as JSON."""
    public = f"{key}.pub"
    page = recorder("verify", "--public-key", public, *flight)
    (document,) = json.loads(recorder("verify", "--json", *flight).stdout)

    assert page.returncode == 0, page.stderr
    assert len(page.stdout.splitlines()) == 4
    assert page.stdout.endswith("\n20180504T120000Z: fits\n")
    assert document["verdict"] == "fits"
    assert document["first_fault"] is None
    assert [segment["chain_end"] for segment in document["segments"]][:2] == [
        segment["chain_start"] for segment in document["segments"]
    ][1:]


def test_changed_picture_is_named(flight: list[Path]) -> None:
    """Exit code 1, and which frame of which file does not fit first."""
    jpeg = list(open_flight([flight[1]]).frames())[2].jpeg
    data = bytearray(flight[1].read_bytes())
    data[data.index(jpeg) + 200] ^= 1
    flight[1].write_bytes(data)
    page, document = recorder("verify", *flight), recorder("verify", "--json", *flight)
    first: dict[str, Any] = json.loads(document.stdout)[0]["first_fault"]

    assert page.returncode == document.returncode == 1
    assert f"DOES NOT FIT; first: {flight[1].name}, damaged: frame " in page.stdout.splitlines()[-1]
    assert first["path"] == str(flight[1])
    assert first["frame"] is not None


def test_missing_segment_exits_with_3(flight: list[Path]) -> None:
    """What is there fits, and what is missing is named."""
    page = recorder("verify", flight[0], flight[2])

    assert page.returncode == 3
    assert "missing segment: segment 1 was not given" in page.stdout


def test_other_key_exits_with_1(flight: list[Path], tmp_path: Path) -> None:
    """Signed by somebody else."""
    recorder("keygen", tmp_path / "other.key")
    page = recorder("verify", "--public-key", tmp_path / "other.key.pub", *flight)

    assert page.returncode == 1
    assert "signed with another key" in page.stdout


def test_info_shows_the_evidence(flight: list[Path]) -> None:
    """How many segments are chained, signed and marked."""
    assert recorder("mark", "--directory", flight[0].parent, "why not").returncode == 0
    page, document = recorder("info", *flight), recorder("info", "--json", *flight)

    assert "evidence:    chained 3 of 3, signed 3 of 3, marked 2 of 3\n" in page.stdout
    assert [file["marked"] for file in json.loads(document.stdout)["files"]].count(True) == 2


def test_power_cut_is_repaired(flight: list[Path], key: Path) -> None:
    """Exit code 3 where something was lost, 0 where not; what is recovered can be signed; again does nothing."""
    cut, whole = flight[2].with_name(flight[2].name + ".part"), flight[1].with_name(flight[1].name + ".part")
    cut.write_bytes(flight[2].read_bytes()[:-1500])
    flight[2].unlink()
    flight[1].rename(whole)
    with_loss = recorder("recover", "--key", key, cut)
    without = recorder("recover", "--json", whole)
    again = recorder("recover", *flight)

    assert (with_loss.returncode, without.returncode, again.returncode) == (3, 0, 0)
    assert f"frames recovered into {flight[2].name}" in with_loss.stdout
    assert json.loads(without.stdout)[0]["outcome"] == "finished"
    assert again.stdout.count("is whole, nothing to do") == 3
    assert recorder("verify", "--public-key", f"{key}.pub", *flight).returncode == 3


def test_file_in_work_is_left_alone(tmp_path: Path) -> None:
    """It says so, and that is no failure."""
    at = ClockReading(10**18, 0)
    writer = SegmentWriter(
        tmp_path / "R_0000.mcap", session=Session("R", started=at), status=CameraStatus("connected"), attachments={}
    )
    result = recorder("recover", tmp_path / "R_0000.mcap.part")
    writer.abandon()

    assert result.returncode == 0
    assert "left alone" in result.stdout


def test_what_cannot_be_recovered_does_not_stop_the_rest(flight: list[Path], tmp_path: Path) -> None:
    """Each file has its sentence; the exit code is the worst."""
    (tmp_path / "empty.mcap.part").touch()
    result = recorder("recover", tmp_path / "empty.mcap.part", tmp_path / "none.mcap.part", flight[0])

    assert result.returncode == 1
    assert len(result.stderr.splitlines()) == 2
    assert "nothing to do" in result.stdout


def test_mark_takes_the_directory_from_the_configuration(flight: list[Path], tmp_path: Path) -> None:
    """With the daemon's own recorder.yaml; neither or both is wrong usage."""
    config = tmp_path / "recorder.yaml"

    assert recorder("mark", "--config", config).returncode == 0
    assert flight[2].with_name(flight[2].name + ".keep").exists()
    assert recorder("mark").returncode == 2
    assert recorder("mark", "--config", config, "--directory", tmp_path).returncode == 2
    assert recorder("mark", "--directory", tmp_path / "flights" / "none").returncode == 1


def test_key_that_cannot_be_used_is_a_wrong_configuration(write_config: WriteConfig, tmp_path: Path) -> None:
    """One sentence, exit code 78, nothing is recorded."""
    result = recorder("run", "--config", write_config(evidence={"key": "none.key"}))

    assert result.returncode == 78
    assert result.stderr.startswith("Error: evidence.key: ")
    assert result.stderr.count("\n") == 1
    assert not list((tmp_path / "flights").glob("*.mcap*"))


@pytest.mark.parametrize("command", ["recover", "verify", "mark", "keygen"])
def test_help_has_examples(command: str) -> None:
    """Every command shows how it is used."""
    assert "Examples:\n" in recorder(command, "--help").stdout


def test_unsigned_box_loads_no_cryptography() -> None:
    """The package is loaded only where a key is used."""
    code = "import sys, recorder.command_run, recorder.command_verify, recorder.command_recover; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert not [name for name in done.stdout.split() if name.startswith("cryptography")]
