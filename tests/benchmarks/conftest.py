"""Sources of pictures are decoded by a process in which the program is already loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.programs import ran


@pytest.fixture(autouse=True)
def forked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `make bench` measures the cost of, without the cost of starting it."""

    def decode(flight: Path, folder: Path) -> None:
        done = ran("decode", flight, "-o", folder)
        assert done.returncode == 0, done.stderr

    monkeypatch.setattr("benchmarks.real_pictures.decode", decode)
