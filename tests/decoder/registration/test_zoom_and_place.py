"""Frames of any zoom, size, lens and place: one map; raised needles are where they are seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import Raised, camera_over_panel
from decoder.panel.camera import Camera, parse_camera
from decoder.panel.errors import AlignmentLost, PanelError, PictureError
from decoder.panel.lens import Lens
from decoder.registration.aligner import Aligner
from tests.decoder.registration.plane import furthest_px, panel_of, see, turn
from tests.poses import pose_at

ALL = ("north_west", "north_east", "south_west", "south_east", "north", "south")
SIZE_PX = (640, 480)
NOISE = {"noise": 1.5, "seed": 7}


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


@pytest.mark.parametrize("known", [False, True], ids=["by EXIF alone", "with a camera"])
@pytest.mark.parametrize("focal_length_mm", [4.0, 5.3])
def test_zoom_steps_lose_no_frame(*, known: bool, focal_length_mm: float) -> None:
    """At each zoom the panel is found where the zoom has it, shaken and rolled as it is."""
    camera = camera_of(0.0) if known else None
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5), optics=Optics(SIZE_PX, 5.0, camera))
    truth = zoom_of(camera, focal_length_mm) @ turn(shift_px=(6.0, -4.0), roll_deg=1.0)
    found = aligner.align(see(truth, **NOISE), focal_length_mm)

    assert furthest_px(found.matrix, truth) < 0.12


def test_frames_of_twice_the_size_are_read_with_the_same_panel() -> None:
    """An Original among 2M pictures differs by its scale alone."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5), optics=Optics(SIZE_PX, 5.0))
    doubled = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]]) @ turn(shift_px=(3.0, 2.0))
    found = aligner.align(see(doubled, size_px=(1280, 960), **NOISE), 5.0)

    assert furthest_px(found.matrix, doubled) < 0.15


@pytest.mark.parametrize("size_px", [(480, 640), (900, 400)], ids=str)
def test_frames_of_another_shape_are_searched_as_any_others(size_px: tuple[int, int]) -> None:
    """A film of 16:9 with a photograph of 4:3, and one held upright: the sensor's crop does not matter."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5))
    truth = turn(shift_px=(size_px[0] / 2 - 320.0, size_px[1] / 2 - 240.0), roll_deg=1.0, scale=0.7)
    found = aligner.align(see(truth, size_px=size_px, **NOISE))

    assert furthest_px(found.matrix, truth) < 0.2


def test_a_strip_thinner_than_what_is_searched_for_is_lost_not_a_crash() -> None:
    """Any shape may occur: of one row nothing is left when frames are searched at reduced size."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3), noise=1.0, seed=5))
    with pytest.raises(AlignmentLost):
        aligner.align(np.random.default_rng(0).integers(0, 255, (1, 640)).astype(np.uint8))


@pytest.mark.parametrize(
    ("size_px", "focal_length_mm", "says"),
    [
        ((640, 360), 5.0, r"the picture is 640 x 360, the panel's 640 x 480"),
        ((640, 480), 20.0, r"covers 4 to 12 mm, the picture was taken at 20 mm"),
    ],
)
def test_frame_of_another_shape_or_uncalibrated_zoom_is_refused(
    size_px: tuple[int, int], focal_length_mm: float, says: str
) -> None:
    """With a camera's calibration, it is missing, with both sizes or the calibrated zooms as the reason."""
    aligner = Aligner(panel_of(ALL), see(np.eye(3)), optics=Optics(SIZE_PX, 5.0, camera_of(0.0)))

    with pytest.raises(PictureError, match=says):
        aligner.align(see(np.eye(3), size_px=size_px), focal_length_mm)


@pytest.mark.parametrize("k1", [-0.15, 0.1])
@pytest.mark.parametrize("motion", [{"shift_px": (9.0, -7.0), "roll_deg": 2.0}, {"tilt": (0.05, -0.05)}], ids=str)
def test_distortion_is_part_of_the_alignment(k1: float, motion: dict[str, Any]) -> None:
    """Panel picture and frame are both bent by the lens: every point still lies where it is seen."""
    camera = camera_of(k1)
    lens = camera.lens(5.0, SIZE_PX)
    optics = Optics(SIZE_PX, 5.0, camera)
    panel = panel_of(ALL)
    aligner = Aligner(panel, see(np.eye(3), lens=lens, noise=1.0, seed=5), optics=optics)
    truth = turn(**motion)
    found = aligner.align(see(truth, lens=lens, **NOISE), 5.0)

    assert furthest_px(found.matrix, truth) < 0.05
    x, y, depth = truth @ (520.0, 380.0, 1.0)
    seen = lens.distorted(np.array([[x / depth], [y / depth]]))[:, 0]
    assert found.to_frame((520.0, 380.0)) == pytest.approx(tuple(seen), abs=0.05)


LENS = Lens((1600, 1200), (799.5, 599.5), 1300.0)
ANGLES = st.floats(-30.0, 30.0)
ON_THE_PANEL = np.array([[-2.0, 0.0, 3.0], [1.0, -1.5, 2.0], [1.0, 1.0, 1.0]])


@settings(derandomize=True, max_examples=50)
@given(attitude=st.tuples(ANGLES, ANGLES, ANGLES), x=st.floats(-8, 8), y=st.floats(-8, 8), y_up=st.booleans())
def test_camera_is_found_over_the_panel(
    attitude: tuple[float, float, float], x: float, y: float, *, y_up: bool
) -> None:
    """Foot and distance come back from the plane's homography, whichever way y is counted."""
    position = (x, y, 14.0)
    pose = pose_at(position, attitude, y_up=y_up)
    found = camera_over_panel(np.linalg.inv(LENS.matrix) @ pose.homography(LENS))

    assert found == pytest.approx(position, abs=1e-6)


@settings(derandomize=True, max_examples=50)
@given(yaw=ANGLES, pitch=ANGLES, x=st.floats(-8, 8), y=st.floats(-8, 8), height=st.floats(0.02, 1.0))
def test_raised_points_lie_where_a_camera_sees_them(
    yaw: float, pitch: float, x: float, y: float, height: float
) -> None:
    """Also in a frame from another place than the panel picture: exactly where the camera model puts them."""
    inches = pose_at((1.0, -2.0, 15.0), (1.0, 8.0, -5.0)).homography(LENS)
    pose = pose_at((x, y, 14.0), (2.0, pitch, yaw))
    alignment = Alignment.of(pose.homography(LENS) @ np.linalg.inv(inches), 1.0, lens=LENS)
    raised = Raised(height, tuple((inches / inches[2, 2]).ravel().tolist()))
    seen = alignment.after(raised.seen_in(alignment)).matrix @ inches @ ON_THE_PANEL
    expected = pose.homography(LENS, height) @ ON_THE_PANEL

    assert seen[:2] / seen[2] == pytest.approx(expected[:2] / expected[2], abs=1e-6)


def test_height_without_a_camera_is_a_sentence() -> None:
    """The message names what is missing for the camera's position."""
    panel = panel_of(("north", "south"))
    gauge = panel.gauges[0].model_copy(update={"needle_height_inches": 0.1})
    source = PanelPictures(panel.model_copy(update={"gauges": (gauge,)}), {"panel.png": see(np.eye(3))}, "0")

    with pytest.raises(
        PanelError,
        match=r"gauges\[0\]\.needle_height_inches: .* give four `reference_points` and `focal_length_mm` and",
    ):
        source.grid(0)


def test_needle_above_its_face_is_unwrapped_around_where_it_is_seen() -> None:
    """A raised needle's grid samples the picture shifted from the face's points; seen square on, at its centre."""
    camera = parse_camera("picture_size: [640, 480]\nfocal: {pixels_per_radian: [800, 0, 0], range_mm: [4, 6]}\n")
    references = [
        {"at": [x, y], "inches": [(x - 319.5) / 80, (y - 239.5) / 80]}
        for x, y in ((20.0, 20.0), (620.0, 20.0), (620.0, 460.0), (20.0, 460.0))
    ]
    panel = panel_of(("north", "south"), reference_points=references, focal_length_mm=5.0)
    gauge = panel.gauges[0].model_copy(update={"needle_height_inches": 0.5})
    source = PanelPictures(
        panel.model_copy(update={"gauges": (gauge,)}), {"panel.png": see(np.eye(3))}, "0", camera=camera
    )
    raised = source.grid(0).raised
    assert raised is not None
    motion = Alignment.of(raised.seen_in(source.optics.own), 1.0)

    assert motion.to_frame((319.5, 239.5)) == pytest.approx((319.5, 239.5), abs=1e-6)
    assert motion.to_frame((419.5, 239.5)) == pytest.approx((319.5 + 100 * 10 / 9.5, 239.5), abs=1e-6)
