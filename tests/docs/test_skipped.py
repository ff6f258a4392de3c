"""A run of the tests says what it skipped for want of something, and how to get that."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests.programs import ROOT


@pytest.mark.slow
def test_a_run_ends_with_a_line_for_each_missing_thing() -> None:
    """Without Chromium and systemd, with workers; the runner's own line stays the last."""
    suites = ["tests/setup/test_page.py", "tests/systemd/test_unit.py"]
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "-p", "no:cacheprovider", *suites]
    done = subprocess.run(command, cwd=ROOT, env={"PATH": ""}, capture_output=True, text=True, check=False)
    *_, browser, systemd, closing = done.stdout.splitlines()

    assert done.returncode == 0, done.stdout
    assert re.fullmatch(
        r"skipped \d+ in tests/setup: no Chromium; apt-get install -y chromium fonts-dejavu-core", browser
    )
    assert systemd == "skipped 4 in tests/systemd: no systemd-analyze; apt-get install -y systemd"
    assert re.match(r"\d+ passed, \d+ skipped in ", closing)
    assert done.stdout.count("Chromium") == 1
