"""Programs are run as their users run them, and measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.programs import FIXTURES, peak_memory_mib


@pytest.mark.slow
@pytest.mark.untraced
def test_memory_of_a_decode_is_its_own(tmp_path: Path) -> None:
    """More than an interpreter with its libraries takes, and far less than this process has with all tests."""
    assert 60.0 < peak_memory_mib(FIXTURES / "thesis_a1.mcap", tmp_path) < 300.0
