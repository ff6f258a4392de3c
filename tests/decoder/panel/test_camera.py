"""camera.yaml: one calibration for every zoom and size, errors by path; its lens model compared with OpenCV."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.optics import Optics
from decoder.panel.camera import camera_from_file, parse_camera
from decoder.panel.errors import CameraError
from decoder.panel.lens import BrownConrady, Fisheye, Lens

DOCUMENT: dict[str, Any] = {
    "model": "DSC-QX10",
    "picture_size": [1616, 1212],
    "focal": {
        "pixels_per_radian": [12.0, 300.0, -0.5],
        "covariance": [[4.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.0]],
        "range_mm": [4.45, 44.5],
    },
    "distortion": [{"focal_length_mm": 10.0, "k1": -0.02}, {"focal_length_mm": 4.45, "k1": -0.08, "p1": 0.002}],
}

Change = Callable[[dict[str, Any]], object]


def camera_text(change: Change = lambda _: None) -> str:
    """The camera above, changed."""
    content = copy.deepcopy(DOCUMENT)
    change(content)
    return yaml.safe_dump(content)


def test_pixels_per_radian_is_the_quadratic() -> None:
    """At the calibration's own size."""
    lens = parse_camera(camera_text()).lens(10.0, (1616, 1212))

    assert lens.pixels_per_radian == pytest.approx(12 + 3000 - 50)
    assert lens.pixels_per_radian_sigma == pytest.approx((4 + 0.01 * 100) ** 0.5)
    assert lens.principal_point_px == (807.5, 605.5)


def test_an_original_and_a_2m_picture_share_a_calibration() -> None:
    """All lengths scale with the width; the outer edges of the pictures, not their pixel centres, coincide."""
    camera = parse_camera(camera_text(lambda c: c.update(principal_point=[800.0, 600.0])))
    small, large = camera.lens(10.0, (1616, 1212)), camera.lens(10.0, (4896, 3672))

    assert large.pixels_per_radian / small.pixels_per_radian == pytest.approx(4896 / 1616)
    for axis in (0, 1):
        ratio = (large.principal_point_px[axis] + 0.5) / (small.principal_point_px[axis] + 0.5)
        assert ratio == pytest.approx(4896 / 1616)
    assert large.distortion == small.distortion


def test_distortion_is_interpolated_between_focal_lengths_and_kept_beyond() -> None:
    """In any order of the file."""
    camera = parse_camera(camera_text())

    for focal_length_mm, k1, p1 in [(4.45, -0.08, 0.002), (7.225, -0.05, 0.001), (40.0, -0.02, 0.0)]:
        bend = camera.lens(focal_length_mm, (1616, 1212)).distortion
        assert bend.coefficients == pytest.approx((k1, 0, p1, 0, 0))


@pytest.mark.parametrize(
    ("focal_length_mm", "size_px", "distortion", "says"),
    [
        (4.4, (1616, 1212), [], r"covers 4.45 to 44.5 mm, .* taken at 4.4 mm; calibrate with"),
        (10.0, (1616, 1080), [], "shaped like 1616 x 1212, this one is"),
        (10.0, (1212, 1616), [], "shaped like 1616 x 1212, this one is"),
        (4.45, (1616, 1212), [{"focal_length_mm": 4.45, "k1": -2.0}], "distortion: at 4.45 mm it folds the picture"),
    ],
)
def test_picture_without_a_lens_is_refused(
    focal_length_mm: float, size_px: tuple[int, int], distortion: list[dict[str, float]], says: str
) -> None:
    """Another zoom, a crop or a turned picture, and a point that would have no line of sight; EXIF may be rounded."""
    camera = parse_camera(camera_text(lambda content: content.update(distortion=distortion)))
    with pytest.raises(CameraError, match=says):
        camera.lens(focal_length_mm, size_px)

    assert distortion or not camera.lens(44.51, (1616, 1212)).distorts


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.pop("focal"), "focal: is missing"),
        (lambda c: c.update(lens="Sony G"), "lens: is not a key of the camera format"),
        (lambda c: c["focal"].update(range_mm=[44.5, 4.45]), "focal: range_mm must run from"),
        (lambda c: c["focal"].update(pixels_per_radian=[0, 300, -5]), "focal: pixels_per_radian must be positive and"),
        (lambda c: c["focal"].update(pixels_per_radian=[1, 2]), "focal.pixels_per_radian"),
        (lambda c: c["focal"].update(covariance=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "focal.covariance: is no cov"),
        (lambda c: c["distortion"][1].pop("k1"), "distortion[1].k1: is missing"),
        (lambda c: c["distortion"][1].update(focal_length_mm=10.0), "distortion: has two entries for one"),
        (lambda c: c["distortion"][1].update(model="fisheye"), "distortion[1]: model fisheye has no p1; it has k1, k2"),
        (lambda c: c["distortion"][0].update(k4=0.1), "distortion[0]: model brown_conrady has no k4"),
        (lambda c: c["distortion"][0].update(model="fisheye"), "distortion: has entries of two models"),
        (lambda c: c.update(principal_point=[2000, 3]), "principal_point lies outside"),
        (lambda c: c.update(picture_size=[0, 3]), "picture_size[0]"),
    ],
)
def test_what_is_wrong_is_named_with_its_path(change: Change, says: str) -> None:
    """The first wrong value, by its path."""
    with pytest.raises(CameraError) as caught:
        parse_camera(camera_text(change))

    assert str(caught.value).startswith("camera.yaml: ")
    assert says in str(caught.value)


@pytest.mark.parametrize(("text", "says"), [("[1", "line 1: is not YAML"), ("- 1", "holds no camera"), ("", "holds")])
def test_what_is_no_camera_is_said(text: str, says: str) -> None:
    """With the page that describes the format."""
    with pytest.raises(CameraError, match=says):
        parse_camera(text)
    with pytest.raises(CameraError, match=r"no.yaml: cannot be read: No such file"):
        camera_from_file(Path("no.yaml"))


SIZE = (1616, 1212)
coefficient = st.floats(-0.15, 0.15)
small = st.floats(-0.01, 0.01)


def grid() -> np.ndarray:
    """(2, 117) pixels all over the picture, its corners among them."""
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 13), np.linspace(0, SIZE[1] - 1, 9))
    return np.stack([x.ravel(), y.ravel()])


def lens(k1: float, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0, k3: float = 0.0) -> Lens:
    """A wide lens with its axis off the middle."""
    return Lens(SIZE, (800.3, 611.9), 1400.0, distortion=BrownConrady((k1, k2, k3), (p1, p2)))


@given(k1=coefficient, k2=small, p1=small, p2=small, k3=small)
def test_distorting_is_opencv_s(k1: float, k2: float, p1: float, p2: float, k3: float) -> None:
    """As cv2.projectPoints has it, and back, to a millionth of a pixel all over the picture."""
    check_against_opencv(lens(k1, k2, p1, p2, k3))


def check_against_opencv(bent: Lens) -> None:
    """Distorts as cv2.projectPoints does with its eight coefficients at most, and back."""
    sights = np.vstack([bent.normalised(grid()), np.ones((1, grid().shape[1]))])
    coefficients = np.array([*bent.distortion.coefficients, 0, 0, 0])[:8]
    projected, _ = cv2.projectPoints(sights.T.copy(), np.zeros(3), np.zeros(3), bent.matrix, coefficients)

    assert bent.distorted(grid()) == pytest.approx(projected[:, 0].T, abs=1e-6)
    assert bent.undistorted(bent.distorted(grid())) == pytest.approx(grid(), abs=1e-6)


@given(k1=coefficient, k2=small, k4=coefficient, k5=small, k6=small)
def test_a_rational_lens_is_opencv_s(k1: float, k2: float, k4: float, k5: float, k6: float) -> None:
    """Both ways, all over the picture."""
    bend = BrownConrady((k1, k2, 0.0), (0.001, -0.002), (k4, k5, k6))
    check_against_opencv(Lens(SIZE, (800.3, 611.9), 1400.0, distortion=bend))


@given(k1=st.floats(-0.05, 0.1), k2=small, k3=small, k4=st.floats(-0.001, 0.001))
def test_a_fisheye_is_opencv_s(k1: float, k2: float, k3: float, k4: float) -> None:
    """Both ways, up to 83 degrees off the axis: beyond, a pinhole's picture is soon infinite."""
    bent = Lens(SIZE, (800.3, 611.9), 700.0, distortion=Fisheye((k1, k2, k3, k4)))
    angle, around = np.meshgrid(np.radians(np.linspace(0, 83, 40)), np.linspace(0, 2 * np.pi, 12))
    tangents = np.tan(angle.ravel()) * np.stack([np.cos(around.ravel()), np.sin(around.ravel())])
    sights = bent.pixels(tangents)
    seen = cv2.fisheye.distortPoints(tangents.T[:, None].copy(), bent.matrix, np.array([k1, k2, k3, k4]))

    assert bent.distorted(sights) == pytest.approx(seen[:, 0].T, abs=1e-6)
    assert bent.normalised(bent.undistorted(np.asarray(seen[:, 0].T, np.float64))) == pytest.approx(tangents, abs=1e-7)


def test_behind_a_fisheye_there_is_no_number() -> None:
    """Points at the side or behind have no place in a pinhole's picture; all others have, up to its corners."""
    wide = Lens(SIZE, (807.5, 605.5), 500.0, distortion=Fisheye())
    seen = wide.undistorted(np.array([[807.5, 1500.0, 1607.5], [605.5, 605.5, 605.5]]))

    assert seen[:, 0] == pytest.approx([807.5, 605.5])
    assert seen[0, 1] == pytest.approx(807.5 + 500 * np.tan(692.5 / 500))
    assert np.isnan(seen[:, 2]).all()
    assert wide.reaches_corners()
    assert not Lens(SIZE, (807.5, 605.5), 500.0, distortion=Fisheye((-0.3, 0, 0, 0))).reaches_corners()


def test_a_lens_that_does_not_zoom_needs_no_focal_length() -> None:
    """Films do not state one."""
    fixed = parse_camera(camera_text(lambda c: c["focal"].update(range_mm=[4.45, 4.45])))

    assert Optics((1616, 1212), camera=fixed).lens == fixed.lens(4.45, (1616, 1212))
    assert Optics((1616, 1212), camera=parse_camera(camera_text())).lens is None


def test_a_pinhole_changes_nothing() -> None:
    """To the bit."""
    assert not lens(0.0).distorts
    assert np.array_equal(lens(0.0).undistorted(grid()), grid())
    assert np.array_equal(lens(0.0).distorted(grid()), grid())


def test_where_no_line_of_sight_arrives_there_is_no_number() -> None:
    """A barrel lens sees nothing beyond its fold; points near the axis are not affected."""
    bent = lens(-0.15)
    points = bent.undistorted(np.array([[810.0, 9000.0], [600.0, 9000.0]]))

    assert np.isfinite(points[:, 0]).all()
    assert np.isnan(points[:, 1]).all()
