"""`recorder recover`, `verify`, `mark` and `keygen` as their users run them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from flight_file.frame import CameraStatus, ClockReading
from flight_file.reader import open_flight
from flight_file.session import Session
from flight_file.writer import SegmentWriter
from tests.programs import write_yaml
from tests.recorder.helpers import recorder


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory, forty_pictures: Path) -> Path:
    """A folder with a key, recorder.yaml and a signed flight of three segments, all made by the commands."""
    folder = tmp_path_factory.mktemp("box")
    key, config = folder / "recorder.key", folder / "recorder.yaml"
    document = {
        "camera": {"driver": "replay", "path": str(forty_pictures), "rate_hz": 4, "pace": "fastest"},
        "storage": {"directory": "flights", "segment_s": 4},
        "evidence": {"key": key.name},
    }
    write_yaml(config, document)
    assert recorder("keygen", key).stdout == f"private key: {key}\npublic key:  {key}.pub\n"
    assert len(recorder("run", "--config", config).stdout.splitlines()) == 3
    return folder


@pytest.fixture
def flight(box: Path, tmp_path: Path) -> list[Path]:
    """The segments, in a copy of that folder."""
    return sorted((shutil.copytree(box, tmp_path / "box") / "flights").glob("*.mcap"))


@pytest.fixture
def key(flight: list[Path]) -> Path:
    """The key that they were signed with."""
    return flight[0].parents[1] / "recorder.key"


def test_recorded_flight_fits_and_says_who_signed(flight: list[Path], key: Path) -> None:
    """One line for each segment, one for the recording; the same as JSON."""
    page = recorder("verify", "--public-key", f"{key}.pub", *flight)
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
    jpeg = list(open_flight([flight[1]]).frames())[2].encoded
    data = bytearray(flight[1].read_bytes())
    data[data.index(jpeg) + 200] ^= 1
    flight[1].write_bytes(data)
    page, document = recorder("verify", *flight), recorder("verify", "--json", *flight)
    first: dict[str, Any] = json.loads(document.stdout)[0]["first_fault"]

    assert page.returncode == document.returncode == 1
    assert f"DOES NOT FIT; first: {flight[1].name}, damaged: frame " in page.stdout.splitlines()[-1]
    assert first["path"] == str(flight[1])
    assert first["frame"] is not None


def test_missing_segment_and_another_key_are_told_apart(flight: list[Path], tmp_path: Path) -> None:
    """What is there fits and what is missing is named (3); who signed is somebody else (1)."""
    missing = recorder("verify", flight[0], flight[2])
    recorder("keygen", tmp_path / "other.key")
    other = recorder("verify", "--public-key", tmp_path / "other.key.pub", *flight)

    assert (missing.returncode, other.returncode) == (3, 1)
    assert "missing segment: segment 1 was not given" in missing.stdout
    assert "signed with another key" in other.stdout


def test_mark_takes_the_directory_from_the_configuration_and_info_shows_it(flight: list[Path], key: Path) -> None:
    """With the daemon's own recorder.yaml; neither or both is wrong usage. How many are chained, signed and marked."""
    config = key.with_name("recorder.yaml")

    assert recorder("mark", "--config", config, "why not").returncode == 0
    assert (flight[2].parent / "marks" / f"{flight[2].name}.keep").exists()
    assert recorder("mark").returncode == 2
    assert recorder("mark", "--config", config, "--directory", key.parent).returncode == 2
    assert recorder("mark", "--directory", key.parent / "none").returncode == 1
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


def test_what_cannot_be_recovered_does_not_stop_the_rest(flight: list[Path], tmp_path: Path) -> None:
    """Each file has its sentence, also one that is in work; the exit code is the worst."""
    (tmp_path / "empty.mcap.part").touch()
    session = Session("R", started=ClockReading(10**18, 0))
    writer = SegmentWriter(tmp_path / "R_0000.mcap", session=session, status=CameraStatus("connected"), attachments={})
    parts = [tmp_path / f"{name}.mcap.part" for name in ("empty", "none", "R_0000")]
    result, alone = recorder("recover", *parts, flight[0]), recorder("recover", parts[2])
    writer.abandon()

    assert (result.returncode, alone.returncode) == (1, 0)
    assert len(result.stderr.splitlines()) == 2
    assert "nothing to do" in result.stdout
    assert "left alone" in result.stdout


def test_key_that_others_may_use_is_refused(key: Path, flight: list[Path]) -> None:
    """By whatever would sign with it, as ssh does: one sentence, exit code 78."""
    run, recover = ("run", "--config", key.with_name("recorder.yaml")), ("recover", "--key", key, flight[0])
    for mode, words in ((0o640, run), (0o604, recover), (0o620, recover)):
        key.chmod(mode)
        result = recorder(*words)

        assert result.returncode == 78
        assert result.stderr == (
            f"Error: evidence.key: {key}: may be used by others than its owner; take their rights away (chmod 600).\n"
        )


def test_file_that_the_box_did_not_write_stays_unsigned(flight: list[Path], key: Path, tmp_path: Path) -> None:
    """Whoever put it there: it is recovered, and said to prove nothing."""
    recorder("keygen", tmp_path / "other.key")
    part = flight[2].with_name(flight[2].name + ".part")
    part.write_bytes(flight[2].read_bytes()[:-5000])
    flight[2].unlink()
    flight[2].with_name(flight[2].name + ".sig").unlink()
    done = recorder("recover", "--key", tmp_path / "other.key", part)
    page = recorder("verify", "--public-key", f"{key}.pub", *flight)

    assert done.returncode == 3
    assert "not signed: nothing in the file proves that this key recorded it" in done.stdout
    assert page.returncode == 1
    assert "not signed: it has neither a signature nor a checkpoint: it proves nothing" in page.stdout
