"""Oblique dials: squared up by reference points or by their rim, so that angles are those seen square on."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from decoder.imaging.camera_pose import Pose
from decoder.imaging.dial_plane import dial_plane, inches_to_picture
from decoder.imaging.optics import Optics
from decoder.imaging.planes import DialPlane
from decoder.panel.camera import Camera, Focal
from decoder.panel.errors import PanelError
from decoder.panel.lens import Lens
from decoder.panel.panel import Panel, parse_panel
from tests.poses import pose_at

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
    return dial_plane(
        panel.gauges[0], "gauges[0]", optics, inches_to_picture(panel.reference_points, panel.level, optics)
    )


def angle_errors_deg(plane: DialPlane, pose: Pose, lens: Lens, *, y_up: bool = False) -> np.ndarray:
    """Errors of a needle's reading at each angle, degrees."""
    seen = lens.undistorted(pose.pixels(on_dial(ANGLES_DEG, y_up=y_up), lens).T)
    x, y, depth = np.linalg.inv(plane.matrix) @ np.vstack([seen, np.ones(seen.shape[1])])
    found = np.degrees(np.arctan2(y / depth, x / depth))
    return np.asarray((found - ANGLES_DEG + 180.0) % 360.0 - 180.0)


@settings(max_examples=25, derandomize=True, phases=[Phase.explicit, Phase.generate])
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


FRONT, SIDE = (20.0, -15.0, 3.0), (25.0, 5.0, 1.0)
SQUARED_UP: list[tuple[tuple[float, float, float], Mapping[str, float], float, bool, float]] = [
    # to a third of a pixel, as by hand
    *((view, {"points": 6, "noise": 0.3}, 0.0, False, 0.1) for view in ((35, 0, 2), (-25, 20, 2), (10, -30, 2))),
    # a lens that bends straight lines changes no angle, once its camera is known
    *((FRONT, {"points": 6}, k1, True, 0.05) for k1 in (-0.2, 0.1)),
    *((FRONT, {"rim": 12, "points": 4}, k1, True, 0.05) for k1 in (-0.2, 0.1)),
    # with the camera known, three points give its position; `level` chooses where two positions fit
    (SIDE, {"points": 3}, 0.0, True, 0.05),
]


@pytest.mark.parametrize(("view", "marks", "k1", "is_known", "within_deg"), SQUARED_UP)
def test_marks_square_up_a_dial(
    view: tuple[float, float, float], marks: Mapping[str, float], k1: float, within_deg: float, *, is_known: bool
) -> None:
    """Angles are those seen from the front, as exactly as marks and camera are known."""
    camera = camera_of(k1)
    lens, pose = camera.lens(FOCAL_MM, SIZE_PX), pose_of(*view)
    ends = pose.pixels(np.array([[-3.0, -3.0], [-3.0, 3.0]]), lens)
    panel = panel_of(pose, lens, **marks).model_copy(update={"level": tuple(map(tuple, ends.tolist()))})
    plane = plane_of(panel, camera if is_known else None)

    assert plane is not None
    assert np.abs(angle_errors_deg(plane, pose, lens)).max() < within_deg


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (-25.0, 20.0), (35.0, 0.0)])
@pytest.mark.parametrize("points", [5, 16])
def test_rim_squares_up_its_dial(yaw: float, pitch: float, points: int) -> None:
    """Points on a circle about the pivot suffice without reference points; 0 degrees is then right in the picture."""
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


@pytest.mark.parametrize(("points", "camera"), [(3, None), (0, camera_of())], ids=["three, no camera", "none"])
def test_too_few_points_leave_the_dial_as_it_is(points: int, camera: Camera | None) -> None:
    """Without a rim as well, it counts as seen square on."""
    lens = camera_of().lens(FOCAL_MM, SIZE_PX)

    assert plane_of(panel_of(pose_of(20.0, 0.0, 0.0), lens, points=points), camera) is None


def on_a_line(content: dict[str, Any]) -> None:
    """Reference points that all lie on one line."""
    for step, point in enumerate(content["reference_points"]):
        point |= {"inches": [step, 0], "at": [100 + 90 * step, 300]}


def exchanged(content: dict[str, Any]) -> None:
    """Two points have exchanged their `inches`."""
    one, other, *_ = content["reference_points"]
    one["inches"], other["inches"] = other["inches"], one["inches"]


def no_circle(content: dict[str, Any]) -> None:
    """A point of the rim is misplaced."""
    content["gauges"][0]["rim"][-1] = [40, 900]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (on_a_line, r"reference_points: lie on one line"),
        (exchanged, r"reference_points: do not fit one plane"),
        (no_circle, r"gauges\[0\]\.rim: is no circle around the gauge's centre"),
    ],
)
def test_marks_that_fit_no_plane_are_refused(spoil: Callable[[dict[str, Any]], None], says: str) -> None:
    """A mistake in the panel is one sentence."""
    panel = panel_of(pose_of(10.0, 0.0, 0.0), camera_of().lens(FOCAL_MM, SIZE_PX), points=6, rim=8)
    content = panel.model_dump(mode="json", exclude_none=True)
    spoil(content)

    with pytest.raises(PanelError, match=says):
        plane_of(parse_panel(yaml.safe_dump(content)), None)
