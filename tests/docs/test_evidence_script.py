"""What docs/evidence.md tells an outside person to do works, and finds what it should."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLIGHT = ROOT / "fixtures" / "thesis_a1.mcap"


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """The script of the document, in a file."""
    (code,) = re.findall(
        r"^```python\n(.*?)^```", (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    path = tmp_path / "chain.py"
    path.write_text(code, encoding="utf-8")
    return path


def run(script: Path, *flights: Path) -> subprocess.CompletedProcess[str]:
    """Run the script on flight files, without anything of ours in reach."""
    command = [sys.executable, "-I", str(script), *map(str, flights)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_script_recomputes_the_chain(script: Path) -> None:
    """It comes to the value that `recorder verify` shows."""
    done = run(script, FLIGHT)
    recorder = [sys.executable, "-c", "from recorder.cli import main; main()", "verify", str(FLIGHT)]
    verified = subprocess.run(recorder, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[1][:16] in verified.stdout


def test_script_finds_a_changed_record(script: Path, tmp_path: Path) -> None:
    """A digit of a frame's time, with the CRCs switched off, does not fit."""
    script.write_text(script.read_text(encoding="utf-8").replace(", validate_crcs=True", ""), encoding="utf-8")
    forged = tmp_path / "forged.mcap"
    data = bytearray(FLIGHT.read_bytes())
    place = data.index(b'"sequence":7,"captured":{"sec":') + 35
    data[place] = ord("1") if data[place] != ord("1") else ord("2")
    forged.write_bytes(data)
    done = run(script, forged)

    assert done.returncode == 1
    assert "frame 7 does not fit" in done.stderr
