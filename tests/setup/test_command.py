"""`decode setup` as a program: it says where its page is, and Ctrl-C is its ordinary end."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

DECODE = Path(sys.executable).parent / "decode"
PICTURE = Path(__file__).parents[2] / "fixtures" / "panel.jpg"


@pytest.mark.untraced
def test_ctrl_c_ends_the_page_without_a_complaint(tmp_path: Path) -> None:
    """The address that is printed gives the page; Ctrl-C ends it with exit code 0 and not a word of anything lost."""
    command = [DECODE, "setup", PICTURE, "--no-browser", "--save-as", tmp_path / "panel.yaml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        try:
            assert running.stdout is not None
            found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", running.stdout.readline())
            assert found is not None
            with urllib.request.urlopen(found[0], timeout=60) as page:  # noqa: S310 - our own
                assert page.status == 200
            running.send_signal(signal.SIGINT)
            _, complaint = running.communicate(timeout=60)
        finally:
            running.kill()

    assert (running.returncode, complaint) == (0, "")
