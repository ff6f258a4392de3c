"""Zoom and distortion: frames of any zoom and size are aligned, and a lens's distortion is part of the one map."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from decoder.aligner import Aligner
from decoder.alignment import Alignment
from decoder.camera import Camera, parse_camera
from decoder.errors import PictureError
from decoder.optics import Optics
from decoder.panel import Panel
from decoder.pictures import GreyPicture

ALL = ("north_west", "north_east", "south_west", "south_east", "north", "south")
SIZE_PX = (640, 480)
NOISE = {"noise": 1.5, "seed": 7}
PLACES = [(120.0, 100.0), (320.0, 240.0), (520.0, 380.0), (150.0, 400.0)]
See = Callable[..., GreyPicture]
PanelOf = Callable[..., Panel]
Turn = Callable[..., Any]


def camera_of(k1: float) -> Camera:
    """A camera whose pixels per radian do not quite grow with the focal length, and with some distortion."""
    distortion = f"distortion: [{{focal_length_mm: 5.0, k1: {k1}}}]" if k1 else ""
    return parse_camera(
        f"picture_size: [640, 480]\nfocal: {{pixels_per_radian: [30, 110, 0.2], range_mm: [4, 12]}}\n{distortion}\n"
    )


def zoom_of(camera: Camera | None, focal_length_mm: float) -> np.ndarray:
    """What another focal length than 5 mm does to the picture, by the definition of both models."""
    scale = focal_length_mm / 5.0
    if camera is not None:
        scale = camera.focal.at(focal_length_mm) / camera.focal.at(5.0)
    there = np.array([[1.0, 0.0, 319.5], [0.0, 1.0, 239.5], [0.0, 0.0, 1.0]])
    return there @ np.diag([scale, scale, 1.0]) @ np.linalg.inv(there)


def worst_px(found: Alignment, truth: np.ndarray) -> float:
    """The largest distance from the truth, distortion aside."""
    errors = []
    for x, y in PLACES:
        one, other = found.matrix @ (x, y, 1.0), truth @ (x, y, 1.0)
        errors.append(np.hypot(*(one[:2] / one[2] - other[:2] / other[2])))
    return float(max(errors))


@pytest.mark.parametrize("known", [False, True], ids=["by EXIF alone", "with a camera"])
@pytest.mark.parametrize("focal_length_mm", [4.0, 4.4, 5.0, 5.3])
def test_zoom_steps_lose_no_frame(
    see: See, panel_of: PanelOf, turn: Turn, *, known: bool, focal_length_mm: float
) -> None:
    """At each zoom the panel is found where the zoom has it, shaken and rolled as it is."""
    camera = camera_of(0.0) if known else None
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5), optics=Optics(SIZE_PX, 5.0, camera))
    truth = zoom_of(camera, focal_length_mm) @ turn(shift_px=(6.0, -4.0), roll_deg=1.0)
    found = aligner.align(see(truth, **NOISE), focal_length_mm)

    assert worst_px(found, truth) < 0.12


def test_frames_of_twice_the_size_are_read_with_the_same_panel(see: See, panel_of: PanelOf, turn: Turn) -> None:
    """An Original among 2M pictures differs by its scale alone."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5), optics=Optics(SIZE_PX, 5.0))
    doubled = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]]) @ turn(shift_px=(3.0, 2.0))
    found = aligner.align(see(doubled, size_px=(1280, 960), **NOISE), 5.0)

    assert worst_px(found, doubled) < 0.15


def test_frame_of_another_shape_is_refused(see: See, panel_of: PanelOf) -> None:
    """A picture of another shape says both sizes."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3)), optics=Optics(SIZE_PX, 5.0))

    with pytest.raises(PictureError, match=r"the picture is 640 x 360, the panel's 640 x 480"):
        aligner.align(np.zeros((360, 640), np.uint8), 5.0)


def test_focal_length_outside_the_calibration_is_a_sentence(see: See, panel_of: PanelOf) -> None:
    """A frame at a zoom that was not calibrated is missing, and says what to do."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3)), optics=Optics(SIZE_PX, 5.0, camera_of(0.0)))

    with pytest.raises(PictureError, match=r"covers 4 to 12 mm, the picture was taken at 20 mm"):
        aligner.align(see(np.eye(3)), 20.0)


@pytest.mark.parametrize("k1", [-0.15, 0.1])
@pytest.mark.parametrize("motion", [{}, {"shift_px": (9.0, -7.0), "roll_deg": 2.0}, {"tilt": (0.05, -0.05)}], ids=str)
def test_distortion_is_part_of_the_alignment(
    see: See, panel_of: PanelOf, turn: Turn, k1: float, motion: dict[str, Any]
) -> None:
    """Panel picture and frame are both bent by the lens: every point still lies where it is seen."""
    camera = camera_of(k1)
    lens = camera.lens(5.0, SIZE_PX)
    optics = Optics(SIZE_PX, 5.0, camera)
    panel = panel_of(ALL)
    aligner = Aligner(panel, see(np.eye(3), lens=lens, noise=1.0, seed=5), optics=optics)
    truth = turn(**motion)
    found = aligner.align(see(truth, lens=lens, **NOISE), 5.0)

    assert worst_px(found, truth) < 0.05
    x, y, depth = truth @ (520.0, 380.0, 1.0)
    seen = lens.distorted(np.array([[x / depth], [y / depth]]))[:, 0]
    assert found.to_frame((520.0, 380.0)) == pytest.approx(tuple(seen), abs=0.05)
