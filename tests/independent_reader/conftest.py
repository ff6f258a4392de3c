"""Other people's readers of MCAP, installed as locked."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

Read = Callable[..., dict[str, Any]]
HERE = Path(__file__).parent
UNREACHABLE = ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED", "ECONNRESET", "ENETUNREACH", "ETIMEDOUT", "ERR_SOCKET_TIMEOUT")


@pytest.fixture(scope="session")
def read(pytestconfig: pytest.Config) -> Read:
    """Runs one of the scripts here, its packages installed as locked and kept from one run to the next."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are not installed")
    lock = (HERE / "package-lock.json").read_bytes()
    cache = pytestconfig.cache
    assert cache is not None
    folder = Path(cache.mkdir("independent_reader")) / hashlib.sha256(lock).hexdigest()[:12]
    if not folder.exists():  # installed aside and moved into place: another run may do the same at this moment
        with TemporaryDirectory(dir=folder.parent) as aside:
            work = Path(aside) / "work"
            shutil.copytree(HERE, work, ignore=shutil.ignore_patterns("node_modules", "__pycache__"))
            install = ["npm", "ci", "--ignore-scripts"]
            done = subprocess.run(install, cwd=work, capture_output=True, text=True, check=False)
            if any(error in done.stderr for error in UNREACHABLE):
                pytest.skip("the npm registry cannot be reached")
            assert done.returncode == 0, done.stderr
            with contextlib.suppress(OSError):
                work.rename(folder)
    for script in HERE.glob("*.mjs"):
        shutil.copyfile(script, folder / script.name)

    def run(script: str, *words: Path) -> dict[str, Any]:
        command = ["node", script, *map(str, words)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        found: dict[str, Any] = json.loads(done.stdout)
        return found

    return run
