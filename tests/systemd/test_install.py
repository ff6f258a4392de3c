"""install.sh, below a directory of its own; the running system is left alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from recorder.cli import DONE_WITH_LOSS as LOSS
from recorder.config import load_config
from tests.programs import write_yaml

SYSTEMD = Path(__file__).parents[2] / "systemd"
FILES = {
    "etc/NetworkManager/system-connections/camera.nmconnection",
    "etc/recorder/recorder.yaml",
    "etc/recorder/recorder.yaml.example",
    "etc/systemd/system/recorder.service",
    "etc/sysusers.d/recorder.conf",
    "etc/tmpfiles.d/recorder.conf",
    "usr/local/bin/recorder",
    "usr/local/share/doc/recorder/box.md",
    "usr/local/share/doc/recorder/cameras.md",
}
DEVICES = {"etc/systemd/system/recorder.service.d/devices.conf", "etc/udev/rules.d/60-recorder.rules"}
JOIN = ("--camera", "DIRECT-reQ0:DSC-QX10", "--interface", "wlan1")


def install(*words: str, password: str = "pass & word\n") -> subprocess.CompletedProcess[str]:  # noqa: S107 - an example
    """Run it."""
    command = ["sh", str(SYSTEMD / "install.sh"), *words]
    return subprocess.run(command, input=password, capture_output=True, text=True, check=False, timeout=60)


def tree(root: Path) -> dict[str, bytes]:
    """All files below a directory, with their content."""
    return {
        str(path.relative_to(root)): str(path.readlink()).encode() if path.is_symlink() else path.read_bytes()
        for path in root.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def test_dry_run_says_what_it_would_do_and_does_nothing(tmp_path: Path) -> None:
    """Each command is shown, nothing is there afterwards, and it needs no right; what it does not know ends it."""
    done, real = install("--dry-run", "--root", str(tmp_path), *JOIN), install("--dry-run")

    assert done.returncode == 0
    assert "recorder.service" in done.stdout
    assert all(line.startswith("would ") for line in done.stdout.splitlines())
    assert list(tmp_path.iterdir()) == []
    assert "would run: systemctl enable recorder.service" in real.stdout
    assert "would run: systemd-sysusers" in real.stdout
    assert "\nwould run: sync\nwould run: systemctl restart recorder.service\n" in real.stdout
    assert "--require-hashes" in real.stdout
    wrong = (("--nonsense",), ("--root",), ("--camera", ""), ("--driver", "webcam", "--dry-run"))
    assert [install(*words).returncode for words in wrong] == [2, 2, 2, 2]


def test_installing_twice_is_installing_once(tmp_path: Path) -> None:
    """The same files, the camera's name and password in one; a configuration that somebody wrote is never touched."""
    first = install("--root", str(tmp_path), *JOIN)
    before = tree(tmp_path)
    profile = tmp_path / "etc/NetworkManager/system-connections/camera.nmconnection"
    lines = profile.read_text(encoding="utf-8").splitlines()
    config = tmp_path / "etc/recorder/recorder.yaml"
    config.write_text("camera: {driver: qx10}  # mine", encoding="utf-8")
    second = install("--root", str(tmp_path), *JOIN)
    after = tree(tmp_path)

    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    assert set(before) == FILES
    assert profile.stat().st_mode & 0o777 == 0o600
    assert {"ssid=DIRECT-reQ0:DSC-QX10", "psk=pass & word", "interface-name=wlan1"} <= set(lines)
    assert "routing-rule2=priority 1065 oif wlan1 table 1064" in lines
    assert not [line for line in lines if "@" in line and not line.startswith("#")]
    assert after == {**before, "etc/recorder/recorder.yaml": b"camera: {driver: qx10}  # mine"}


@pytest.mark.parametrize(
    ("driver", "more"), [("qx10", set()), ("uvc", DEVICES), ("picamera", DEVICES), ("rtsp", set())]
)
def test_each_driver_gets_what_it_needs_and_keeps_it(tmp_path: Path, driver: str, more: set[str]) -> None:
    """Its configuration as an example; access to devices where it has one, also when installed again without a word."""
    words = ("--root", str(tmp_path))
    done = [install(*words, "--driver", driver), install(*words)]
    config, _ = load_config(tmp_path / "etc/recorder/recorder.yaml")
    files = set(tree(tmp_path))
    other = install(*words, "--driver", "qx10")

    assert [each.returncode for each in (*done, other)] == [0, 0, 0]
    assert config.camera.driver == driver
    assert files == (FILES - {"etc/NetworkManager/system-connections/camera.nmconnection"}) | more
    assert not set(tree(tmp_path)) & DEVICES


@pytest.mark.parametrize("camera", ["driver: uvc", "{driver : 'uvc'}", '{"driver": "uvc", "device": "/dev/video0"}'])
def test_driver_of_a_configuration_is_kept_however_it_is_written(tmp_path: Path, camera: str) -> None:
    """Installing a newer version takes no camera's access away."""
    config = tmp_path / "etc/recorder/recorder.yaml"
    config.parent.mkdir(parents=True)
    config.write_text(f"camera:\n  # driver: rtsp\n  {camera}\nstorage: {{directory: flights}}\n", encoding="utf-8")
    done = install("--root", str(tmp_path))

    assert done.returncode == 0
    assert set(tree(tmp_path)) >= DEVICES


def test_driver_that_cannot_be_found_is_asked_for(tmp_path: Path) -> None:
    """Rather than to install for another camera."""
    config = tmp_path / "etc/recorder/recorder.yaml"
    config.parent.mkdir(parents=True)
    config.write_text("camera:\n  driver:\n    uvc\n", encoding="utf-8")
    done = install("--root", str(tmp_path))

    assert done.returncode == 1
    assert "give --driver" in done.stderr


def test_video_is_installed_for_ip_cameras_alone() -> None:
    """FFmpeg takes more room than all the rest of the box's program."""
    for driver in ("qx10", "uvc", "picamera", "rtsp"):
        said = install("--program-only", "/nowhere", "--driver", driver, "--dry-run").stdout

        assert ("requirements-video.lock" in said) == (driver == "rtsp")


@pytest.mark.parametrize(
    ("name", "interface", "password", "sentence"),
    [
        ("n" * 33, "wlan0", "password", "1 to 32 bytes, not 33"),
        ("\u20ac" * 11, "wlan0", "password", "1 to 32 bytes, not 33"),
        ("camera", "wlan0\n[ipv4]\nmethod=disabled", "password", "cannot be the name of a network interface"),
        ("camera", "a" * 16, "password", "cannot be the name of a network interface"),
        ("camera", "wlan0", "seven77", "8 to 63 characters"),
        ("camera", "wlan0", "", "8 to 63 characters"),
        ("camera", "wlan0", "g" * 64, "8 to 63 characters"),
        ("camera", "wlan0", "password\nand more", "8 to 63 characters"),
    ],
)
def test_wifi_that_cannot_be_is_refused_before_anything_is_done(
    tmp_path: Path, name: str, interface: str, password: str, sentence: str
) -> None:
    """In one sentence, which does not show the password."""
    done = install("--root", str(tmp_path), "--camera", name, "--interface", interface, password=password)

    assert done.returncode == 1
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not password or password not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("line", ["iface wlan1 inet dhcp", "  iface wlan1"])
def test_wifi_that_networkmanager_leaves_alone_is_refused(tmp_path: Path, line: str) -> None:
    """As where Debian was installed over that Wi-Fi: the camera would never be joined, and nothing would say so."""
    interfaces = tmp_path / "etc/network/interfaces"
    interfaces.parent.mkdir(parents=True)
    interfaces.write_text(f"auto lo\niface lo inet loopback\n# iface wlan0\n{line}\n", encoding="utf-8")
    named, other = install("--root", str(tmp_path), *JOIN), install("--root", str(tmp_path), *JOIN[:3], "wlan0")
    dry = install("--dry-run", "--root", str(tmp_path), *JOIN)

    assert (named.returncode, other.returncode, dry.returncode) == (1, 0, 0)
    assert named.stderr.endswith("while /etc/network/interfaces names it; take it out of there.\n")
    assert named.stderr.count("\n") == 1
    assert "would fail: NetworkManager leaves wlan1 alone" in dry.stdout


def test_wifi_needs_an_interface_that_is_there() -> None:
    """Boards name theirs differently; joined with another one the camera would never be."""
    said = "would fail: there is no network interface"

    assert f"{said} nothing0; `ip link` lists them" in install("--dry-run", *JOIN[:3], "nothing0").stdout
    assert said not in install("--dry-run", *JOIN[:3], "lo").stdout


def test_wifi_needs_a_program_that_joins_it(tmp_path: Path) -> None:
    """Debian's NetworkManager does without: the dry run says that it is missing, and the page has it installed."""
    page = (SYSTEMD.parent / "docs" / "box.md").read_text(encoding="utf-8")
    (packages,) = (line.split() for line in page.splitlines() if "apt-get install" in line)
    found = shutil.which("wpa_supplicant", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    said = "would fail: NetworkManager joins no Wi-Fi without wpa_supplicant"
    without = install("--dry-run", *JOIN)
    (tmp_path / "wpa_supplicant").symlink_to("/bin/true")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
        joined = install("--dry-run", *JOIN)

    assert {"network-manager", "wpasupplicant"} <= set(packages)
    assert (said in without.stdout) == (found is None and not Path("/usr/libexec/iwd").exists())
    assert said not in joined.stdout


def test_files_can_be_read_by_the_recorder_whatever_the_mask_of_who_installs(tmp_path: Path) -> None:
    """All but the password; a root who keeps files private is no reason for a recorder that cannot start."""
    command = f"umask 077; sh {SYSTEMD / 'install.sh'} --root {tmp_path / 'root'} --camera {JOIN[1]}"
    subprocess.run(["sh", "-c", command], input="password", text=True, check=True, capture_output=True)
    closed = {path.name for path in tmp_path.rglob("root/**/*") if path.is_file() and not path.stat().st_mode & 0o004}

    assert closed == {"camera.nmconnection"}
    assert [path.name for path in tmp_path.rglob("root/**/") if path.stat().st_mode & 0o777 not in {0o755, 0o700}] == []


OFFLINE = "after connection broken by"  # pip, once for each time that it tries again


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recorder as install.sh puts it on a box, in an environment that has nothing else."""
    folder = tmp_path_factory.mktemp("box") / "program"
    command = ["sh", str(SYSTEMD / "install.sh"), "--program-only", str(folder)]
    done = subprocess.run(command, env=bare(), capture_output=True, text=True, check=False, timeout=600)
    if done.returncode != 0 and OFFLINE in done.stderr:
        pytest.skip("PyPI cannot be reached")
    assert done.returncode == 0, done.stderr
    return folder / "bin" / "recorder"


def bare() -> dict[str, str]:
    """An environment without what would let a program find the packages of this one."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "COV", "VIRTUAL"))}


@pytest.mark.slow
@pytest.mark.untraced
@pytest.mark.xdist_group("installed box")
def test_installed_box_records_from_a_camera(program: Path, tmp_path: Path) -> None:
    """Signed, from the simulated camera, with nothing but what install.sh installs."""

    def start(*words: str | Path) -> subprocess.Popen[str]:
        command, pipe = [program, *words], subprocess.PIPE
        return subprocess.Popen(command, env=bare(), cwd=tmp_path, text=True, stdout=pipe, stderr=pipe)

    def end(process: subprocess.Popen[str]) -> list[str]:
        said, complained = process.communicate(timeout=60)
        assert process.returncode in {0, LOSS}, complained  # it may be stopped while a picture is on its way
        return said.splitlines()

    end(start("keygen", "recorder.key"))
    camera = start("simulate", "--shot-s", "0", "--ledger", "ledger")
    assert camera.stdout is not None
    config = {
        "camera": {"driver": "qx10", "url": camera.stdout.readline().strip(), "interval_s": 0},
        "storage": {"directory": "flights", "keep_free_gib": 0},
        "evidence": {"key": "recorder.key"},
    }
    write_yaml(tmp_path / "recorder.yaml", config)
    box, limit = start("run", "--config", "recorder.yaml"), time.monotonic() + 60
    ledger = tmp_path / "ledger"
    while ledger.read_text("utf-8").count("\n") < 3 and box.poll() is None and time.monotonic() < limit:
        time.sleep(0.05)
    box.send_signal(signal.SIGTERM)
    flights = end(box)
    camera.send_signal(signal.SIGTERM)
    end(camera)

    told = json.loads("\n".join(end(start("info", "--json", *flights))))
    assert told["frames"] >= 2
    end(start("verify", "--public-key", "recorder.key.pub", *flights))


@pytest.mark.slow
@pytest.mark.untraced
@pytest.mark.xdist_group("installed box")
def test_every_command_of_the_installed_box_starts(program: Path) -> None:
    """Each has a help, and none needs what is only on the desk."""
    code = """
import click, recorder.cli
for name in recorder.cli.COMMANDS:
    recorder.cli.main.main([name, "--help"], standalone_mode=False)
"""
    python = program.with_name("python")
    done = subprocess.run([python, "-I", "-c", code], env=bare(), capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Usage: ") >= 9


def test_uninstalling_leaves_what_people_made(tmp_path: Path) -> None:
    """The configuration and the recordings stay; doing it again does no harm."""
    install("--root", str(tmp_path), *JOIN)
    recording = tmp_path / "var/lib/recorder/20180504T120000Z_0000.mcap"
    recording.parent.mkdir(parents=True)
    recording.touch()
    done = [install("--uninstall", "--root", str(tmp_path)) for _ in range(2)]

    assert [result.returncode for result in done] == [0, 0]
    assert set(tree(tmp_path)) == {"etc/recorder/recorder.yaml", "var/lib/recorder/20180504T120000Z_0000.mcap"}


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_script_is_clean() -> None:
    """As shellcheck sees it."""
    done = subprocess.run(["shellcheck", SYSTEMD / "install.sh"], capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stdout
