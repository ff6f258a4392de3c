"""`decode setup` as a program: it says where its page is, and Ctrl-C is its ordinary end."""

from __future__ import annotations

import re
import signal
import urllib.request
from pathlib import Path

import pytest

from tests.programs import FIXTURES, begun, ran, says

PICTURE = FIXTURES / "panel.jpg"


@pytest.mark.untraced
def test_ctrl_c_ends_the_page_without_a_complaint(tmp_path: Path) -> None:
    """The address that is printed gives the page; Ctrl-C ends it with exit code 0 and not a word of anything lost."""
    with begun("decode", "setup", PICTURE, "--no-browser", "--save-as", tmp_path / "panel.yaml") as running:
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


def test_camera_that_is_none_is_said(tmp_path: Path) -> None:
    """A camera.yaml that cannot be used ends the command before a page is opened."""
    camera = tmp_path / "camera.yaml"
    camera.write_text("lens: none\n", encoding="utf-8")

    says(ran("decode", "setup", PICTURE, "--camera", camera, "--no-browser"), "camera.yaml")


def test_a_folder_of_photographs_is_told_how_to_become_a_flight(tmp_path: Path) -> None:
    """The command that makes one stands in the sentence, ready to be typed."""
    folder = tmp_path / "my photographs"
    folder.mkdir()
    says(
        ran("decode", "setup", folder, "--no-browser"),
        f"decode: {folder}: is a directory",
        f"recorder replay '{folder}' -o 'my photographs.mcap'",
    )
