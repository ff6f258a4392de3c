"""What docs/evidence.md tells an outside person to do works, and finds what it should."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from flight_file.frame import CameraStatus, ClockReading, Frame, HostTimes
from flight_file.scan import scan_file
from flight_file.segment import opened
from flight_file.session import Session
from flight_file.signature import load_signer, make_key_files
from flight_file.writer import SegmentWriter
from tests.programs import ROOT, ran

FLIGHT = ROOT / "fixtures" / "thesis_a1.mcap"


def written(path: Path, word: str) -> Path:
    """The script of the document in which a word stands, in a file."""
    page = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    (code,) = [code for code in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL) if word in code]
    path.write_text(code, encoding="utf-8")
    return path


@pytest.fixture
def signed(tmp_path: Path) -> tuple[Path, Path]:
    """A public key, and a segment that was signed with the other half."""
    make_key_files(tmp_path / "box.key")
    at = ClockReading(10**18, 0)
    writer = SegmentWriter(
        tmp_path / "R_0000.mcap",
        session=Session("R", started=at),
        status=CameraStatus("connected"),
        attachments={},
        signer=load_signer(tmp_path / "box.key"),
    )
    for number in range(4):
        jpeg = bytes([number]) * 500
        frame = Frame(number, number, jpeg, hashlib.sha256(jpeg).hexdigest(), HostTimes(at, at, at))
        writer.write_frame(frame, at)
        writer.sync(at)
    return tmp_path / "box.key.pub", writer.finish("stopped", dropped=0, at=at)


def run(script: Path, *flights: Path) -> subprocess.CompletedProcess[str]:
    """Run the script on flight files, without anything of ours in reach."""
    command = [sys.executable, "-I", str(script), *map(str, flights)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_script_recomputes_the_chain_and_finds_a_changed_record(tmp_path: Path) -> None:
    """It comes to the value that `recorder verify` shows; a digit of a time, CRCs switched off, does not fit."""
    script = written(tmp_path / "chain.py", "def link")
    whole = run(script, FLIGHT)
    assert whole.returncode == 0, whole.stderr
    assert whole.stdout.split()[1][:16] in ran("recorder", "verify", FLIGHT).stdout

    script.write_text(script.read_text(encoding="utf-8").replace(", validate_crcs=True", ""), encoding="utf-8")
    forged = tmp_path / "forged.mcap"
    data = bytearray(FLIGHT.read_bytes())
    place = data.index(b'"sequence":7,"captured":{"sec":') + 35
    data[place] = ord("1") if data[place] != ord("1") else ord("2")
    forged.write_bytes(data)
    done = run(script, forged)

    assert done.returncode == 1
    assert "frame 7 does not fit" in done.stderr


def test_script_says_how_far_a_segment_is_proven(signed: tuple[Path, Path], tmp_path: Path) -> None:
    """Of a finished one and of one that was cut off: to the end of its last checkpoint; unless a byte was changed."""
    checkpoints = written(tmp_path / "checkpoints.py", "public_key")
    key, flight = signed
    with opened(flight) as source:
        points = scan_file(flight, source).checkpoints
    cut = flight.with_name("cut.mcap.part")
    cut.write_bytes(flight.read_bytes()[: points[3].end + 100])
    done = run(checkpoints, key, flight, cut)

    assert done.returncode == 0, done.stderr
    assert len(points) == 5
    assert f"{flight}: proven up to byte {points[-1].end} of {flight.stat().st_size}" in done.stdout
    assert f"{cut}: proven up to byte {points[3].end} of {cut.stat().st_size}" in done.stdout

    make_key_files(tmp_path / "other.key")
    other = run(checkpoints, tmp_path / "other.key.pub", flight)
    data = flight.read_bytes()
    place = data.index(bytes([2]) * 500)
    flight.write_bytes(data[:place] + b"\x03" + data[place + 1 :])
    changed = run(checkpoints, key, flight)

    assert (other.returncode, changed.returncode) == (1, 1)
    assert "is not of this key" in other.stderr
    assert "were changed" in changed.stderr
