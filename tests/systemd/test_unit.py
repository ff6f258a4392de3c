"""The unit, as systemd itself judges it; and the files beside it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from recorder.config import load_config, parse_config
from recorder.failures import WRONG_CONFIGURATION
from recorder.settings import StorageSettings
from recorder.signs_of_life import SILENCE_S
from recorder.supervision import END_S

SYSTEMD = Path(__file__).parents[2] / "systemd"
UNIT = SYSTEMD / "recorder.service"
LARGEST_EXPOSURE = 15  # tenths; systemd calls up to 20 OK

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def setting(name: str) -> str:
    """A setting of the unit."""
    (value,) = re.findall(rf"^{name}=(.*)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE)
    return str(value)


@needs_systemd
def test_unit_is_one_that_systemd_takes(tmp_path: Path) -> None:
    """Nothing in it is unknown or misspelt."""
    unit = tmp_path / UNIT.name
    unit.write_text(UNIT.read_text(encoding="utf-8").replace("/opt/recorder/bin/recorder", "/bin/true"))
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stderr) == (0, "")


@needs_systemd
def test_unit_is_hardened() -> None:
    """Its exposure is at most 1.5."""
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={LARGEST_EXPOSURE}", UNIT]
    done = subprocess.run(command, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stdout.splitlines()[-1]


def test_unit_and_recorder_agree() -> None:
    """On the watchdog, on how long stopping takes, and on the exit code after which there is no use in starting."""
    assert setting("Type") == "notify"
    assert int(setting("WatchdogSec")) > SILENCE_S
    assert int(setting("TimeoutStopSec")) > END_S
    assert setting("RestartPreventExitStatus") == str(WRONG_CONFIGURATION)
    assert setting("Restart") == "always"
    assert setting("StartLimitIntervalSec") == "0"


def test_example_is_a_configuration() -> None:
    """The recorder takes it, and it records where the unit lets it write."""
    config, _ = load_config(SYSTEMD / "recorder.yaml")

    assert str(config.storage.directory) == f"/var/lib/{setting('StateDirectory')}"
    assert config.camera.driver == "qx10"


def test_every_setting_of_the_storage_is_on_the_page() -> None:
    """And its example is a configuration that the recorder takes."""
    page = (SYSTEMD.parent / "docs" / "box.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    config = parse_config(yaml.safe_load(example))
    defaults = StorageSettings(directory=Path())
    rows = dict(re.findall(r"^\| `storage\.(\w+)` \| ([^|]+) \|", page, re.MULTILINE))

    assert config.storage.max_hours == 100
    assert set(rows) == set(StorageSettings.model_fields)
    assert {name: float(value) for name, value in rows.items() if value.isdigit()} == {
        name: getattr(defaults, name) for name, value in rows.items() if value.isdigit()
    }


def test_every_event_of_the_log_is_on_the_page() -> None:
    """What `journalctl` shows is explained."""
    page = (SYSTEMD.parent / "docs" / "box.md").read_text(encoding="utf-8")
    code = "".join(path.read_text(encoding="utf-8") for path in (SYSTEMD.parent / "recorder").glob("*.py"))
    events = set(re.findall(r"journal\.log\.\w+\(\s*\"(\w+)\"", code))

    assert len(events) > 8
    assert {event for event in events if f"`{event}`" not in page} == set()


def test_camera_stays_out_of_the_way_of_other_networks() -> None:
    """Never the default route, no name server, a routing table of its own: its /8 would cover every 10.x network."""
    profile = (SYSTEMD / "camera.nmconnection").read_text(encoding="utf-8")

    assert "never-default=true\nignore-auto-dns=true\nroute-table=1064\n" in profile
    assert "to 10.0.0.1/32 table 1064" in profile


def test_box_gets_the_versions_that_are_tested() -> None:
    """Its list of packages is a part of the project's, and nothing of the desk is in it."""

    def packages(path: Path) -> set[str]:
        return set(re.findall(r"^([a-z0-9-]+==[^ ;\\]+)", path.read_text(encoding="utf-8"), re.MULTILINE))

    box = packages(SYSTEMD / "requirements.lock")

    assert box
    assert box <= packages(SYSTEMD.parent / "requirements.lock")
    assert not {name for name in box if name.startswith(("opencv", "numpy", "pytest"))}
