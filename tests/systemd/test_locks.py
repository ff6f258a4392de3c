"""What a lock installs stays the same, whatever is released after it was written."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
INSTALLERS = {
    "desk": ("make", "--dry-run", "--always-make", ".venv/.ready"),
    "box": ("sh", "systemd/install.sh", "--program-only", "/nowhere", "--dry-run"),
}


def wheel(folder: Path, name: str, version: str, *lines: str) -> Path:
    """Write a wheel that holds nothing but its metadata."""
    path = folder / f"{name}-{version}-py3-none-any.whl"
    about = f"{name}-{version}.dist-info"
    with ZipFile(path, "w") as archive:
        metadata = ("Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}", *lines)
        archive.writestr(f"{about}/METADATA", "\n".join(metadata) + "\n")
        archive.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/RECORD", "")
    return path


@pytest.mark.parametrize("installer", INSTALLERS)
def test_later_release_of_a_package_that_is_needed_with_an_extra_changes_nothing(
    tmp_path: Path, installer: str
) -> None:
    """The pip that comes with Python 3.11 takes the latest of these, finds no hash for it, and installs nothing."""
    pinned = [wheel(tmp_path, "meter", "1.0", "Provides-Extra: toml")]
    pinned.append(wheel(tmp_path, "plugin", "1.0", "Requires-Dist: meter[toml]>=1.0"))
    lock, target = tmp_path / "requirements.lock", tmp_path / "target"
    lock.write_text(
        "".join(
            f"{path.name.split('-')[0]}==1.0 --hash=sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}\n"
            for path in pinned
        ),
        encoding="utf-8",
    )
    wheel(tmp_path, "meter", "1.1", "Provides-Extra: toml")
    shown = subprocess.run(INSTALLERS[installer], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found = re.search(r"\bpip (install .*)-r \S*requirements\.lock", shown)
    assert found is not None, shown

    words = (*found[1].split(), "--no-index", "--find-links", str(tmp_path), "--target", str(target), "-r", str(lock))
    env = {key: value for key, value in os.environ.items() if not key.startswith("PIP_")}
    done = subprocess.run(
        [sys.executable, "-m", "pip", *words], env=env, capture_output=True, text=True, check=False, timeout=60
    )

    assert done.returncode == 0, done.stderr
    assert {path.name for path in target.iterdir()} == {"meter-1.0.dist-info", "plugin-1.0.dist-info"}
