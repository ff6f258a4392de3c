"""Parallax: a needle above its face is looked for where the camera sees it, in every frame anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.alignment import Alignment
from decoder.calibration.view import pose_at
from decoder.camera import parse_camera
from decoder.errors import PanelError
from decoder.lens import Lens
from decoder.panel_pictures import PanelPictures
from decoder.parallax import Raised, camera_over_panel

LENS = Lens((1600, 1200), (799.5, 599.5), 1300.0)
ANGLES = st.floats(-30.0, 30.0)
PLACES = np.array([[-2.0, 0.0, 3.0], [1.0, -1.5, 2.0], [1.0, 1.0, 1.0]])


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
    """In a frame from another place than the panel picture, too: exactly where the model of the camera has them."""
    inches = pose_at((1.0, -2.0, 15.0), (1.0, 8.0, -5.0)).homography(LENS)
    pose = pose_at((x, y, 14.0), (2.0, pitch, yaw))
    alignment = Alignment.of(pose.homography(LENS) @ np.linalg.inv(inches), 1.0, lens=LENS)
    raised = Raised(height, tuple((inches / inches[2, 2]).ravel().tolist()))
    seen = alignment.after(raised.seen_in(alignment)).matrix @ inches @ PLACES
    expected = pose.homography(LENS, height) @ PLACES

    assert seen[:2] / seen[2] == pytest.approx(expected[:2] / expected[2], abs=1e-6)


def test_height_without_a_camera_is_a_sentence(see: Callable[..., Any], panel_of: Callable[..., Any]) -> None:
    """What the camera's position needs and does not have is named."""
    panel = panel_of(("north", "south"))
    gauge = panel.gauges[0].model_copy(update={"needle_height_inches": 0.1})
    source = PanelPictures(panel.model_copy(update={"gauges": (gauge,)}), {"panel.png": see(np.eye(3))}, "0")

    with pytest.raises(
        PanelError,
        match=r"gauges\[0\]\.needle_height_inches: .* give four `reference_points` and `focal_length_mm` and",
    ):
        source.grid(0)


def test_needle_above_its_face_is_unwrapped_around_where_it_is_seen(
    see: Callable[..., Any], panel_of: Callable[..., Any]
) -> None:
    """The grid of a raised needle samples the panel picture beside the face's own points; square on, at its centre."""
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
