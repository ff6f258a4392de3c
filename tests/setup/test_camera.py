"""`decode setup --camera`: the camera on the command line is the one that a draft is tried with."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import yaml

from decoder.camera import camera_from_file
from decoder.setup.session import SetupSession
from decoder.setup.sources import open_source

OBLIQUE = Path(__file__).parents[2] / "fixtures" / "oblique" / "t1a_small"
DECODE = Path(sys.executable).parent / "decode"


def test_camera_on_the_command_line_is_used(tmp_path: Path) -> None:
    """Needles above their face can be read where the camera is known, and only there."""
    document = yaml.safe_load((OBLIQUE / "panel.yaml").read_text(encoding="utf-8"))
    source = open_source([OBLIQUE / "panel.jpg"])  # a picture alone carries no camera
    target = tmp_path / "panel.yaml"
    camera = camera_from_file(OBLIQUE / "camera.yaml")
    without = SetupSession(source, None, target).problems(document, "frame-0")
    known = SetupSession(source, None, target, camera=camera).problems(document, "frame-0")

    assert {each.path for each in without} == {f"gauges[{index}].needle_height_inches" for index in range(12)}
    assert known == []


def test_camera_that_is_none_is_said(tmp_path: Path) -> None:
    """A camera.yaml that cannot be used ends the command before a page is opened."""
    camera = tmp_path / "camera.yaml"
    camera.write_text("lens: none\n", encoding="utf-8")
    command = [DECODE, "setup", OBLIQUE / "panel.jpg", "--camera", camera, "--no-browser"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)

    assert done.returncode == 1
    assert "camera.yaml" in done.stderr
    assert len(done.stderr.splitlines()) == 1
