"""The whole box against the simulated camera, with every fault that it has, one after the other."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader

from camera_drivers.qx10.simulator.behaviour import Behaviour
from camera_drivers.qx10.simulator.faults import DESCRIPTION, DOWNLOAD, FAULTS, SHOT
from camera_drivers.qx10.simulator.simulator import SimulatedQx10
from flight_file.reader import open_flight
from flight_file.verification import Verdict, verify
from recorder.clock import SystemClock
from recorder.config import parse_config
from recorder.host import this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.settings import RecorderConfig
from recorder.stop import Stop

PATIENCE_S = 120
QUICK = Behaviour(
    shot_s=0.01, save_s=0.0, long_poll_s=0.5, delay_s=0.3, reboot_s=0.6, error_s=0.2, silent_s=0.5
)  # a minute of flying in a few seconds
LIMITS = {
    "connect_s": 2.0,
    "call_s": 2.0,
    "shot_s": 2.0,
    "exposure_s": 10.0,
    "download_s": 10.0,
    "event_s": 5.0,
    "ready_s": 5.0,
    "settle_s": 0.6,
    "picture_mib": 1,
}
FIRST_FAULT, BETWEEN_FAULTS = 2, 3


def by_place(place: str) -> list[str]:
    """All faults of a place."""
    return [fault.name for fault in FAULTS.values() if fault.place == place]


def order_all_faults(camera: SimulatedQx10) -> int:
    """Each once, with good pictures between them; gives how many shots it takes."""
    for place in (SHOT, DOWNLOAD):
        for number, name in enumerate(by_place(place)):
            camera.misbehave(name, at=FIRST_FAULT + BETWEEN_FAULTS * number)
    for name in by_place(DESCRIPTION):
        camera.misbehave(name)
    return FIRST_FAULT + BETWEEN_FAULTS * len(by_place(SHOT))


def configuration(url: str, directory: Path) -> RecorderConfig:
    """A box that takes pictures as fast as it can."""
    return parse_config(
        {
            "camera": {"driver": "qx10", "url": url, "interval_s": 0, "limits": LIMITS},
            "storage": {"directory": str(directory), "segment_s": 3, "keep_free_gib": 0},
        }
    )


def run_until(condition: Callable[[], bool], config: RecorderConfig) -> Outcome:
    """Record until it holds."""
    stop, outcomes = Stop(), list[Outcome]()
    box = threading.Thread(
        target=lambda: outcomes.append(record(config, host=this_host(), stop=stop, journal=Journal(io.StringIO())))
    )
    box.start()
    deadline = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    stop.request("the flight is over")
    box.join(PATIENCE_S)
    return outcomes[0]


def statuses(outcome: Outcome) -> list[dict[str, Any]]:
    """All of /camera/status, by an independent reader."""
    found = []
    for path in outcome.paths:
        with path.open("rb") as file:
            read = make_reader(file, validate_crcs=True).iter_messages(topics=["/camera/status"])
            found += [json.loads(message.data) for _, _, message in read]
    return found


@pytest.mark.slow
def test_every_fault_once_and_every_picture_accounted_for(tmp_path: Path) -> None:
    """Each picture that was delivered is in the flight once, byte for byte; each other one with its reason."""
    with SimulatedQx10(SystemClock(), behaviour=QUICK) as camera:
        shots = order_all_faults(camera)
        outcome = run_until(lambda: len(camera.ledger.taken) >= shots, configuration(camera.url, tmp_path))
        delivered = camera.ledger.delivered()
    frames = list(open_flight(outcome.paths).frames())
    stored = [frame.sha256 for frame in frames]
    missing = set(range(frames[-1].sequence + 1)) - {frame.sequence for frame in frames}
    said = statuses(outcome)
    (check,) = verify(outcome.paths)

    # The box may have been stopped while a last picture was on its way.
    assert stored in (delivered, delivered[:-1])
    assert len(stored) > len(FAULTS)
    assert len(missing) > 0
    assert outcome.dropped - len(missing) in {0, 1}
    counts = next(entry["reason"] for entry in reversed(said) if entry["reason"].startswith("dropped: "))
    assert sum(int(word) for word in counts.split() if word.isdigit()) == outcome.dropped
    assert {"connecting", "capturing", "lost", "refused", "finished"} <= {entry["state"] for entry in said}
    assert check.verdict is not Verdict.FAULT


def test_camera_that_falls_silent_does_not_hold_up_the_end(tmp_path: Path) -> None:
    """SIGTERM while a call waits for an answer: the process ends by itself, with a finished file that says why."""
    flights = tmp_path / "flights"
    config = tmp_path / "recorder.yaml"
    with SimulatedQx10(SystemClock(), behaviour=replace(QUICK, silent_s=PATIENCE_S)) as camera:
        config.write_text(
            yaml.safe_dump(
                {
                    "camera": {"driver": "qx10", "url": camera.url, "interval_s": 0},
                    "storage": {"directory": str(flights), "keep_free_gib": 0},
                }
            ),
            encoding="utf-8",
        )
        camera.misbehave("silent", at=3)
        command = [sys.executable, "-c", "from recorder.cli import main; main()", "run", "--config", str(config)]
        box = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + PATIENCE_S
        while len(camera.ledger.deliveries) < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        box.send_signal(signal.SIGHUP)
        box.send_signal(signal.SIGTERM)
        printed, log = box.communicate(timeout=60)
    (path,) = map(Path, printed.splitlines())
    end = open_flight([path]).segments[-1].end

    assert box.returncode == 0, log
    assert end is not None
    assert end.reason.startswith("stopped by SIGTERM")
    assert list(flights.iterdir()) == [path]
