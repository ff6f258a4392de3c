"""camera.yaml is written whole, and what was measured later takes its place beside what is there."""

from __future__ import annotations

import pytest

from decoder.calibration.camera_file import camera_text, merged
from decoder.camera import parse_camera
from decoder.errors import CameraError

FOCAL = {"pixels_per_radian": [0.0, 262.0, 0.0], "range_mm": [4.0, 45.0]}


def test_what_is_written_is_what_is_read() -> None:
    """To ten digits."""
    camera = merged(None, picture_size=(1616, 1212), focal=FOCAL, distortion=[{"focal_length_mm": 4.45, "k1": -1 / 3}])

    assert parse_camera(camera_text(camera)).distortion[0].k1 == pytest.approx(-1 / 3, rel=1e-9)
    assert parse_camera(camera_text(camera)).focal == camera.focal


def test_distortion_replaces_its_own_zoom_only() -> None:
    """The others stay."""
    first = merged(None, picture_size=(1616, 1212), focal=FOCAL, distortion=[{"focal_length_mm": 4.45, "k1": -0.1}])
    second = merged(first, distortion=[{"focal_length_mm": 10.0, "k1": -0.02}])
    third = merged(second, distortion=[{"focal_length_mm": 4.45, "k1": -0.2}])

    assert [(entry.focal_length_mm, entry.k1) for entry in third.distortion] == [(4.45, -0.2), (10.0, -0.02)]
    assert third.focal == first.focal


def test_another_picture_size_is_not_mixed_in() -> None:
    """The numbers would not fit each other."""
    known = merged(None, picture_size=(1616, 1212), focal=FOCAL)

    with pytest.raises(CameraError, match="made from pictures of 1616 x 1212"):
        merged(known, picture_size=(4896, 3672), focal=FOCAL)


def test_a_quadratic_that_falls_is_refused() -> None:
    """Points by hand at three zooms may give one."""
    with pytest.raises(CameraError, match="what was measured: focal: pixels_per_radian must be positive"):
        merged(None, picture_size=(1616, 1212), focal={**FOCAL, "pixels_per_radian": [0.0, 10.0, -5.0]})
