"""`recorder run` against `recorder simulate`, as processes of their own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from camera_drivers.qx10.simulator.faults import FAULTS
from flight_file.reader import open_flight

RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")
PATIENCE_S = 120


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*RECORDER, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


def deliveries(ledger: Path) -> list[dict[str, object]]:
    """What the simulated camera has sent so far."""
    return [json.loads(line) for line in ledger.read_text().splitlines()] if ledger.exists() else []


def test_recorder_stores_what_the_camera_delivered(tmp_path: Path, pictures: Path) -> None:
    """Pictures of a folder, through two processes and some faults: each delivered picture is in the flight once."""
    ledger = tmp_path / "ledger"
    faults = ("cut_short@2", "lost_answer@3", "zero_host@4", "drop_mid_download@6")
    options = [word for fault in faults for word in ("--fault", fault)]
    command = [*RECORDER, "simulate", "--pictures", str(pictures), "--ledger", str(ledger), "--shot-s", "0", *options]
    camera = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert camera.stdout is not None
    url = camera.stdout.readline().strip()
    config = tmp_path / "recorder.yaml"
    config.write_text(
        yaml.safe_dump(
            {
                "camera": {"driver": "qx10", "url": url, "interval_s": 0},
                "storage": {"directory": str(tmp_path / "flights"), "keep_free_gib": 0},
            }
        )
    )
    box = subprocess.Popen(
        [*RECORDER, "run", "--config", str(config)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    end = time.monotonic() + PATIENCE_S
    while len(deliveries(ledger)) < 9 and time.monotonic() < end:
        time.sleep(0.05)
    box.send_signal(signal.SIGTERM)
    paths = [Path(line) for line in box.communicate(timeout=PATIENCE_S)[0].splitlines()]
    camera.send_signal(signal.SIGTERM)
    camera.communicate(timeout=PATIENCE_S)

    assert (box.returncode, camera.returncode) == (0, 0)
    delivered = [line["sha256"] for line in deliveries(ledger) if line["complete"] and line["intact"]]
    stored = [frame.sha256 for frame in open_flight(paths).frames()]
    # The box may have been stopped between the last delivery and its storing, which it tells.
    assert stored in (delivered, delivered[:-1])
    assert len(stored) >= 6


def test_faults_are_listed() -> None:
    """Each with its place and what happens."""
    listed = run("simulate", "--list-faults")

    assert listed.returncode == 0
    assert [line.split()[0] for line in listed.stdout.splitlines()] == list(FAULTS)


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--fault", "none_such"], 2, "There is no fault 'none_such'"),
        (["--fault", "reboot@x"], 2, "write NAME, or NAME@NUMBER"),
        (["--pictures", "/nowhere"], 2, "does not exist"),
        (["--host", "192.0.2.7"], 1, "cannot be used"),
    ],
)
def test_wrong_usage_is_one_sentence(arguments: list[str], code: int, sentence: str) -> None:
    """With click's usage above it where it is about the options."""
    result = run("simulate", *arguments)

    assert result.returncode == code
    assert sentence in result.stderr
    assert "Traceback" not in result.stderr
