"""A small flight, and a disk that is not waited for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flight_file.frame import Frame
from flight_file.signature import Signer, load_signer, make_key_files
from tests.flight_file.flights import make_frame, write_flight


@pytest.fixture(autouse=True)
def _quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of files are written here; that the disk is waited for shows in the recorder's tests."""
    monkeypatch.setattr(os, "fdatasync", lambda _descriptor: None)
    monkeypatch.setattr(os, "fsync", lambda _descriptor: None)


@pytest.fixture
def frames() -> list[Frame]:
    """Six frames, one a second, each in a chunk of its own."""
    return [make_frame(sequence) for sequence in range(6)]


@pytest.fixture
def flight(tmp_path: Path, frames: list[Frame]) -> Path:
    """A finished flight of one file with the six frames and two attachments."""
    attachments = {"panel.yaml": b"name: F-16\n", "panel.jpg": bytes(range(256))}
    (path,) = write_flight(tmp_path, frames, attachments=attachments)
    return path


@pytest.fixture
def signer(tmp_path: Path) -> Signer:
    """The box's key; its public half lies beside it."""
    make_key_files(tmp_path / "box.key")
    return load_signer(tmp_path / "box.key")
