"""The unit, as systemd itself judges it; and the files beside it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from camera_drivers.qx10.discovery import NETWORKS
from camera_drivers.qx10.options import SSDP_ADDRESS
from recorder.cli import WRONG_CONFIGURATION
from recorder.config import StorageSettings, load_config, parse_config
from recorder.thresholds import END_S, SILENCE_S

SYSTEMD = Path(__file__).parents[2] / "systemd"
UNIT = SYSTEMD / "recorder.service"
DESK = SYSTEMD.parent / "requirements.lock"
FSTAB_GENERATOR = Path("/usr/lib/systemd/system-generators/systemd-fstab-generator")
LARGEST_EXPOSURE = 15  # tenths; systemd calls up to 20 OK

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def setting(name: str) -> str:
    """A setting of the unit."""
    (value,) = re.findall(rf"^{name}=(.*)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE)
    return str(value)


@pytest.fixture(params=["network", "devices"])
def unit(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The unit, for a camera on the network or with access to devices."""
    path = tmp_path / UNIT.name
    path.write_text(UNIT.read_text(encoding="utf-8").replace("/opt/recorder/bin/recorder", "/bin/true"))
    if request.param == "devices":
        (tmp_path / "recorder.service.d").mkdir()
        shutil.copy(SYSTEMD / "devices.conf", tmp_path / "recorder.service.d")
    return path


@needs_systemd
def test_unit_is_one_that_systemd_takes(unit: Path) -> None:
    """Nothing in it is unknown or misspelt."""
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stderr) == (0, "")


@needs_systemd
def test_unit_is_hardened(unit: Path) -> None:
    """Its exposure is at most 1.5, with cameras that are devices too."""
    command = ["systemd-analyze", "security", "--offline=true", f"--threshold={LARGEST_EXPOSURE}", unit]
    done = subprocess.run(command, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stdout.splitlines()[-1]


def test_only_cameras_are_let_in() -> None:
    """As devices: no others are opened to the recorder, and only by the group that has the cameras."""
    lines = (SYSTEMD / "devices.conf").read_text(encoding="utf-8").splitlines()
    allowed = {line.removeprefix("DeviceAllow=") for line in lines if line.startswith("DeviceAllow=")}

    assert setting("DevicePolicy") == "closed"
    assert allowed == {"char-video4linux rw", "char-media rw", "char-dma_heap rw"}
    assert {"SupplementaryGroups=video", "KillMode=mixed"} <= set(lines)


def test_unit_and_recorder_agree() -> None:
    """On the watchdog, on how long stopping takes, and on the exit code after which there is no use in starting."""
    assert setting("Type") == "notify"
    assert int(setting("WatchdogSec")) > SILENCE_S
    assert int(setting("TimeoutStopSec")) > END_S
    assert setting("RestartPreventExitStatus") == str(WRONG_CONFIGURATION)
    assert setting("Restart") == "always"
    assert setting("StartLimitIntervalSec") == "0"


def test_recorder_looks_for_a_camera_only_where_the_unit_lets_it() -> None:
    """What it believes to be near is what it may talk to."""
    allowed = set(setting("IPAddressAllow").split()) - {SSDP_ADDRESS[0]}

    assert {str(network).replace("127.0.0.0/8", "localhost") for network in NETWORKS} == allowed


def test_group_reads_recordings_and_writes_marks_alone() -> None:
    """In the folders as the unit and systemd-tmpfiles make them, and as the recorder does where they are missing."""
    lines = (SYSTEMD / "recorder.tmpfiles").read_text(encoding="utf-8").splitlines()
    modes = {line.split()[1]: line.split()[2:5] for line in lines if not line.startswith("#")}
    state = f"/var/lib/{setting('StateDirectory')}"

    assert modes[state] == [setting("StateDirectoryMode"), "recorder", "recorder"]
    assert setting("StateDirectoryMode") == "0750"
    assert modes[f"{state}/marks"] == ["1770", "recorder", "recorder"]


@pytest.mark.skipif(not FSTAB_GENERATOR.exists(), reason="systemd is not installed")
def test_recorder_waits_for_its_disk_and_the_board_does_not(tmp_path: Path) -> None:
    """As systemd reads the page's line for a separate disk: no end to the wait, and nothing else waits with it."""
    page = (SYSTEMD.parent / "docs" / "box.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^LABEL=.*$", page, re.MULTILINE)
    (tmp_path / "fstab").write_text(line + "\n", encoding="utf-8")
    folders = [tmp_path / name for name in ("normal", "early", "late")]
    for folder in folders:
        folder.mkdir()
    subprocess.run([FSTAB_GENERATOR, *folders], env={"SYSTEMD_FSTAB": str(tmp_path / "fstab")}, check=True)
    (mount,) = folders[0].glob("*.mount")
    (device,) = folders[0].glob("*.device.d/*.conf")

    # The unit requires whatever is mounted at its state directory.
    assert f"Where=/var/lib/{setting('StateDirectory')}\n" in mount.read_text(encoding="utf-8")
    assert "Before=" not in mount.read_text(encoding="utf-8")
    assert "JobRunningTimeoutSec=infinity" in device.read_text(encoding="utf-8")


def test_every_setting_of_the_storage_is_on_the_page() -> None:
    """Its example and the one that is installed are taken, and the latter records where the unit lets it write."""
    installed, _ = load_config(SYSTEMD / "recorder.yaml")
    page = (SYSTEMD.parent / "docs" / "box.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    config = parse_config(yaml.safe_load(example))
    defaults = StorageSettings(directory=Path())
    rows = dict(re.findall(r"^\| `storage\.(\w+)` \| ([^|]+) \|", page, re.MULTILINE))

    assert str(installed.storage.directory) == f"/var/lib/{setting('StateDirectory')}"
    assert installed.camera.driver == "qx10"
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


def packages(lock: Path) -> dict[str, str]:
    """Versions by name."""
    return dict(re.findall(r"^([a-z0-9-]+)==([^ ;\\]+)", lock.read_text(encoding="utf-8"), re.MULTILINE))


def test_box_gets_the_versions_that_are_tested() -> None:
    """Its list of packages is a part of the project's, and nothing of the desk is in it."""
    box, video, desk = (
        packages(path) for path in (SYSTEMD / "requirements.lock", SYSTEMD / "requirements-video.lock", DESK)
    )

    assert box
    assert box.items() <= desk.items()
    assert video.items() <= desk.items()
    assert set(video) == {"av"}
    assert not {name for name in box if name.startswith(("opencv", "numpy", "pytest", "av"))}


def test_box_gets_what_its_code_imports() -> None:
    """And what that needs in turn; where this fails, `make lock` mends it."""
    command = [sys.executable, SYSTEMD / "box_requirements.py"]
    stated = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    box = packages(SYSTEMD / "requirements.lock")
    needed = [Requirement(line) for line in stated]
    for name in box:
        lines = metadata.requires(name) or ()
        needed += [each for each in map(Requirement, lines) if not each.marker or each.marker.evaluate({"extra": ""})]

    assert {"defusedxml", "urllib3", "mcap"} <= {each.name for each in needed}
    missing = {str(each) for each in needed if not each.specifier.contains(box.get(canonicalize_name(each.name), "0"))}
    assert missing == set()


def test_import_that_nobody_stated_is_refused(tmp_path: Path) -> None:
    """`make lock` names the module, rather than let the box do without."""
    for name in ("pyproject.toml", "systemd/box_requirements.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((SYSTEMD.parent / name).read_bytes())
    (tmp_path / "recorder").mkdir()
    (tmp_path / "recorder" / "cli.py").write_text("def late():\n    import pytest\n", encoding="utf-8")
    command = [sys.executable, tmp_path / "systemd" / "box_requirements.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)

    assert done.returncode == 1
    assert done.stderr == "recorder/cli.py imports pytest, which pyproject.toml does not state; state it there.\n"
