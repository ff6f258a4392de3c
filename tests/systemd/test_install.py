"""install.sh, below a directory of its own; the running system is left alone."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

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
}
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
    """Each command is shown; nothing is there afterwards."""
    done = install("--dry-run", "--root", str(tmp_path), *JOIN)

    assert done.returncode == 0
    assert "recorder.service" in done.stdout
    assert all(line.startswith("would ") for line in done.stdout.splitlines())
    assert list(tmp_path.iterdir()) == []


def test_dry_run_of_the_real_thing_shows_the_system_commands() -> None:
    """It needs no right to do anything."""
    done = install("--dry-run")

    assert "would run: systemctl enable recorder.service" in done.stdout
    assert "would run: systemd-sysusers" in done.stdout
    assert "--require-hashes" in done.stdout


def test_installing_twice_is_installing_once(tmp_path: Path) -> None:
    """The same files, and a configuration that somebody wrote is never touched."""
    first = install("--root", str(tmp_path), *JOIN)
    before = tree(tmp_path)
    config = tmp_path / "etc/recorder/recorder.yaml"
    config.write_text("mine", encoding="utf-8")
    second = install("--root", str(tmp_path), *JOIN)
    after = tree(tmp_path)

    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    assert set(before) == FILES
    assert after == {**before, "etc/recorder/recorder.yaml": b"mine"}


def test_profile_holds_the_camera_and_is_private(tmp_path: Path) -> None:
    """Name, password and interface are filled in as they are, and only root may read them."""
    install("--root", str(tmp_path), *JOIN)
    profile = tmp_path / "etc/NetworkManager/system-connections/camera.nmconnection"
    lines = profile.read_text(encoding="utf-8").splitlines()

    assert profile.stat().st_mode & 0o777 == 0o600
    assert {"ssid=DIRECT-reQ0:DSC-QX10", "psk=pass & word", "interface-name=wlan1"} <= set(lines)
    assert "routing-rule2=priority 1065 oif wlan1 table 1064" in lines
    assert not [line for line in lines if "@" in line and not line.startswith("#")]


def test_uninstalling_leaves_what_people_made(tmp_path: Path) -> None:
    """The configuration and the recordings stay; doing it again does no harm."""
    install("--root", str(tmp_path), *JOIN)
    recording = tmp_path / "var/lib/recorder/20180504T120000Z_0000.mcap"
    recording.parent.mkdir(parents=True)
    recording.touch()
    done = [install("--uninstall", "--root", str(tmp_path)) for _ in range(2)]

    assert [result.returncode for result in done] == [0, 0]
    assert set(tree(tmp_path)) == {"etc/recorder/recorder.yaml", "var/lib/recorder/20180504T120000Z_0000.mcap"}


@pytest.mark.parametrize(("words", "code"), [(("--nonsense",), 2), (("--help",), 0), (("--root",), 2)])
def test_usage(words: tuple[str, ...], code: int) -> None:
    """What it does not know ends it before anything is done."""
    assert install(*words).returncode == code


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_script_is_clean() -> None:
    """As shellcheck sees it."""
    done = subprocess.run(["shellcheck", SYSTEMD / "install.sh"], capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stdout
