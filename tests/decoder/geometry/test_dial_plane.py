"""Oblique dials: squared up by reference points or by their rim, so that angles are those seen square on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from decoder.calibration.view import Pose, pose_at
from decoder.camera import Camera, Focal
from decoder.dial_plane import DialPlane, dial_plane, inches_to_picture
from decoder.errors import PanelError
from decoder.lens import Lens
from decoder.optics import Optics
from decoder.panel import Panel, parse_panel

SIZE_PX = (1600, 1200)
FOCAL_MM = 5.0
DIAL_INCHES = (1.5, -0.8)
RADIUS_INCHES = 1.0
REFERENCES = [(-4.0, -3.0), (4.0, -3.0), (4.0, 3.0), (-4.0, 3.0), (0.0, 3.2), (-4.2, 0.1)]
ANGLES_DEG = np.arange(0.0, 360.0, 7.5)
TILTS = st.floats(-35.0, 35.0)


def camera_of(k1: float = 0.0) -> Camera:
    """A camera of 1300 pixels per radian; every zoom is the same."""
    content: dict[str, Any] = {"focal": {"pixels_per_radian": [1300.0, 0.0, 0.0], "range_mm": [4.0, 6.0]}}
    if k1:
        content["distortion"] = [{"focal_length_mm": FOCAL_MM, "k1": k1}]
    return Camera(picture_size=SIZE_PX, **{**content, "focal": Focal(**content["focal"])})


def pose_of(yaw_deg: float, pitch_deg: float, roll_deg: float, *, y_up: bool = False) -> Pose:
    """A camera twelve inches away that looks at the middle of the panel."""
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    away = 12.0
    x, y = -away * math.sin(yaw) * math.cos(pitch), away * math.sin(pitch)
    return pose_at(
        (x, -y if y_up else y, away * math.cos(yaw) * math.cos(pitch)), (roll_deg, pitch_deg, yaw_deg), y_up=y_up
    )


def on_dial(angle_deg: npt.ArrayLike, radius_inches: float = RADIUS_INCHES, *, y_up: bool = False) -> np.ndarray:
    """(N, 2) inches: points of the dial, clockwise as seen from the front."""
    angle = np.radians(np.atleast_1d(angle_deg))
    down = np.sin(angle) * radius_inches
    x, y = DIAL_INCHES
    return np.stack([x + np.cos(angle) * radius_inches, y + (-down if y_up else down)], axis=1)


def panel_of(pose: Pose, lens: Lens, *, points: int = 0, rim: int = 0, y_up: bool = False, noise: float = 0.0) -> Panel:
    """A panel as somebody would mark it in the picture, to a tenth of a pixel or with noise."""
    random = np.random.default_rng(3)

    def seen(inches: np.ndarray) -> list[list[float]]:
        return (pose.pixels(inches, lens) + random.normal(0.0, noise, inches.shape)).tolist() if len(inches) else []

    gauge: dict[str, Any] = {
        "name": "dial",
        "centre": pose.pixels(np.array([DIAL_INCHES]), lens)[0].tolist(),
        "radius": [20, 90],
        "sweep": [0, 300],
        "scale": [[0, 0], [300, 1]],
        "needles": [{"name": "value", "template": {"at": 10.0, "span": 10}}],
    }
    if rim:
        gauge["rim"] = seen(on_dial(np.linspace(0, 360, rim, endpoint=False), y_up=y_up))
    at = seen(np.array(REFERENCES[:points]))
    references = [{"at": place, "inches": list(inches)} for place, inches in zip(at, REFERENCES, strict=False)]
    content = {
        "name": "oblique",
        "picture": "panel.png",
        "focal_length_mm": FOCAL_MM,
        "reference_points": references,
        "anchors": [{"name": "knob", "box": [10, 10, 40, 40]}],
        "gauges": [gauge],
    }
    return parse_panel(yaml.safe_dump(content))


def plane_of(panel: Panel, camera: Camera | None) -> DialPlane | None:
    """The plane of its only dial."""
    optics = Optics(SIZE_PX, FOCAL_MM, camera)
    return dial_plane(panel.gauges[0], "gauges[0]", optics, inches_to_picture(panel, optics))


def angle_errors_deg(plane: DialPlane, pose: Pose, lens: Lens, *, y_up: bool = False) -> np.ndarray:
    """What a needle at each angle would be read as too much."""
    seen = lens.undistorted(pose.pixels(on_dial(ANGLES_DEG, y_up=y_up), lens).T)
    x, y, depth = np.linalg.inv(plane.matrix) @ np.vstack([seen, np.ones(seen.shape[1])])
    found = np.degrees(np.arctan2(y / depth, x / depth))
    return np.asarray((found - ANGLES_DEG + 180.0) % 360.0 - 180.0)


@settings(max_examples=60, derandomize=True, phases=[Phase.explicit, Phase.generate])
@given(yaw=TILTS, pitch=TILTS, roll=st.floats(-8, 8), points=st.sampled_from([4, 5, 6]), y_up=st.booleans())
def test_four_reference_points_square_up_any_dial(
    yaw: float, pitch: float, roll: float, points: int, *, y_up: bool
) -> None:
    """Whichever way the writer counts y, angles are those seen from the front: within a hundredth of a degree."""
    camera = camera_of()
    lens = camera.lens(FOCAL_MM, SIZE_PX)
    pose = pose_of(yaw, pitch, roll, y_up=y_up)
    plane = plane_of(panel_of(pose, lens, points=points, y_up=y_up), None)

    assert plane is not None
    assert np.abs(angle_errors_deg(plane, pose, lens, y_up=y_up)).max() < 0.01


@pytest.mark.parametrize(("yaw", "pitch"), [(35.0, 0.0), (-25.0, 20.0), (10.0, -30.0)])
def test_marks_by_hand_cost_little(yaw: float, pitch: float) -> None:
    """Reference points to a third of a pixel leave angles within a tenth of a degree."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)
    pose = pose_of(yaw, pitch, 2.0)
    plane = plane_of(panel_of(pose, lens, points=6, noise=0.3), None)

    assert plane is not None
    assert np.abs(angle_errors_deg(plane, pose, lens)).max() < 0.1


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (20.0, 0.0), (-25.0, 20.0), (35.0, 0.0), (0.0, -35.0)])
@pytest.mark.parametrize("points", [5, 8, 16])
def test_rim_squares_up_its_dial(yaw: float, pitch: float, points: int) -> None:
    """Points on a circle about the pivot do it without reference points; 0 degrees then is right in the picture."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)
    pose = pose_of(yaw, pitch, 0.0)
    plane = plane_of(panel_of(pose, lens, rim=points), None)

    assert plane is not None
    errors = angle_errors_deg(plane, pose, lens)
    assert np.abs(errors - errors.mean()).max() < 0.05
    ahead = plane.to_panel(np.array([[0.0, 1e-3], [0.0, 0.0]]))
    assert abs(ahead[1, 1] - ahead[1, 0]) < 1e-9


@pytest.mark.parametrize("yaw", [0.0, 30.0])
def test_radius_is_in_pixels_where_the_dial_is_largest(yaw: float) -> None:
    """At the centre one unit of the squared-up dial is one pixel where it is not foreshortened."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)
    for marks in ({"points": 5}, {"rim": 12}):
        plane = plane_of(panel_of(pose_of(yaw, 0.0, 0.0), lens, **marks), None)
        assert plane is not None
        steps = plane.to_panel(np.array([[0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]]))
        jacobian = (steps[:, 1:] - steps[:, :1]) / 1e-3
        assert np.linalg.svd(jacobian, compute_uv=False)[0] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("k1", [-0.2, 0.1])
@pytest.mark.parametrize("marks", [{"points": 6}, {"rim": 12, "points": 4}], ids=["points", "rim"])
def test_distortion_is_taken_out_first(k1: float, marks: dict[str, int]) -> None:
    """A lens that bends straight lines changes no angle, once its camera is known."""
    camera = camera_of(k1)
    lens = camera.lens(FOCAL_MM, SIZE_PX)
    pose = pose_of(20.0, -15.0, 3.0)
    plane = plane_of(panel_of(pose, lens, **marks), camera)

    assert plane is not None
    assert np.abs(angle_errors_deg(plane, pose, lens)).max() < 0.05


def test_three_points_and_a_camera_square_up_too() -> None:
    """With the camera known, three points give its position; `level` chooses where two positions fit."""
    camera = camera_of()
    lens = camera.lens(FOCAL_MM, SIZE_PX)
    pose = pose_of(25.0, 5.0, 1.0)
    panel = panel_of(pose, lens, points=3)
    ends = pose.pixels(np.array([[-3.0, -3.0], [-3.0, 3.0]]), lens)
    panel = panel.model_copy(update={"level": tuple(map(tuple, ends.tolist()))})
    plane = plane_of(panel, camera)

    assert plane is not None
    assert np.abs(angle_errors_deg(plane, pose, lens)).max() < 0.05


def test_three_points_without_a_camera_say_nothing() -> None:
    """Without focal length or camera three points leave the dial as it is."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)

    assert plane_of(panel_of(pose_of(20.0, 0.0, 0.0), lens, points=3), None) is None


def test_panel_without_marks_is_read_as_it_is() -> None:
    """No reference points and no rim: the dial counts as seen square on."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)

    assert plane_of(panel_of(pose_of(20.0, 0.0, 0.0), lens), camera_of()) is None


def spoilt(panel: Panel, **changes: Sequence[tuple[float, float]]) -> Panel:
    """The panel with other inches for its reference points."""
    points = tuple(
        point.model_copy(update={"inches": inches, "at": at})
        for point, inches, at in zip(panel.reference_points, changes["inches"], changes["at"], strict=True)
    )
    return panel.model_copy(update={"reference_points": points})


def test_collinear_reference_points_are_refused() -> None:
    """Points on one line tell no perspective: one sentence."""
    panel = panel_of(pose_of(0.0, 0.0, 0.0), camera_of().lens(FOCAL_MM, SIZE_PX), points=4)
    line = [(float(x), 0.0) for x in range(4)]
    at = [(100.0 + 90.0 * x, 300.0) for x in range(4)]

    with pytest.raises(PanelError, match=r"reference_points: lie on one line"):
        plane_of(spoilt(panel, inches=line, at=at), None)


def test_exchanged_reference_points_are_refused() -> None:
    """Two `inches` that stand beside each other's `at` fit no plane: one sentence."""
    panel = panel_of(pose_of(10.0, 0.0, 0.0), camera_of().lens(FOCAL_MM, SIZE_PX), points=6)
    inches = [point.inches for point in panel.reference_points]
    inches[0], inches[1] = inches[1], inches[0]

    with pytest.raises(PanelError, match=r"reference_points: do not fit one plane"):
        plane_of(spoilt(panel, inches=inches, at=[point.at for point in panel.reference_points]), None)


def test_rim_that_is_no_circle_is_refused() -> None:
    """A point of the rim that stands elsewhere is a mistake in the panel."""
    panel = panel_of(pose_of(10.0, 0.0, 0.0), camera_of().lens(FOCAL_MM, SIZE_PX), rim=8)
    rim = [*panel.gauges[0].rim[:-1], (40.0, 900.0)]
    gauge = panel.gauges[0].model_copy(update={"rim": tuple(rim)})

    with pytest.raises(PanelError, match=r"gauges\[0\]\.rim: is no circle around the gauge's centre"):
        plane_of(panel.model_copy(update={"gauges": (gauge,)}), None)
