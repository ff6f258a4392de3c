"""camera.yaml: one calibration for every zoom and picture size, and what is wrong is named with its path."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from decoder.camera import camera_from_file, parse_camera
from decoder.errors import CameraError

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
    assert large.radial == small.radial


def test_distortion_is_interpolated_between_focal_lengths_and_kept_beyond() -> None:
    """In any order of the file."""
    camera = parse_camera(camera_text())

    assert camera.lens(4.45, (1616, 1212)).radial[0] == pytest.approx(-0.08)
    assert camera.lens(7.225, (1616, 1212)).radial[0] == pytest.approx(-0.05)
    assert camera.lens(7.225, (1616, 1212)).tangential[0] == pytest.approx(0.001)
    assert camera.lens(40.0, (1616, 1212)).radial[0] == pytest.approx(-0.02)


def test_a_camera_without_distortion_has_pinhole_lenses() -> None:
    """Nothing is bent."""
    assert not parse_camera(camera_text(lambda c: c.pop("distortion"))).lens(10.0, (1616, 1212)).distorts


@pytest.mark.parametrize("focal_length_mm", [4.4, 45.0])
def test_a_focal_length_outside_the_calibration_is_refused(focal_length_mm: float) -> None:
    """With what it covers and what to do."""
    with pytest.raises(CameraError, match=r"covers 4.45 to 44.5 mm, .* taken at 4[.\d]* mm; calibrate with"):
        parse_camera(camera_text()).lens(focal_length_mm, (1616, 1212))


def test_the_rounding_of_exif_is_no_other_focal_length() -> None:
    """A hundredth of a millimetre."""
    assert parse_camera(camera_text()).lens(44.51, (1616, 1212)).pixels_per_radian > 12000


@pytest.mark.parametrize("size_px", [(1616, 1080), (1212, 1616)])
def test_a_picture_of_another_aspect_is_refused(size_px: tuple[int, int]) -> None:
    """A crop or a turned picture has its axis elsewhere."""
    with pytest.raises(CameraError, match="shaped like 1616 x 1212, this one is"):
        parse_camera(camera_text()).lens(10.0, size_px)


def test_coefficients_that_fold_the_picture_are_refused() -> None:
    """A point of the picture would have no line of sight."""
    camera = parse_camera(camera_text(lambda c: c.update(distortion=[{"focal_length_mm": 4.45, "k1": -2.0}])))

    with pytest.raises(CameraError, match=r"distortion: at 4.45 mm it folds the picture"):
        camera.lens(4.45, (1616, 1212))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.pop("focal"), "focal: is missing"),
        (lambda c: c.update(lens="Sony G"), "lens: is not a key of the camera format"),
        (lambda c: c["focal"].update(range_mm=[44.5, 4.45]), "focal: range_mm must run from"),
        (lambda c: c["focal"].update(pixels_per_radian=[0, 300, -5]), "focal: pixels_per_radian must be positive and"),
        (lambda c: c["focal"].update(pixels_per_radian=[1, 2]), "focal.pixels_per_radian"),
        (lambda c: c["focal"].update(covariance=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), "focal.covariance: is no cov"),
        (lambda c: c["focal"].update(covariance=[[1, 2, 0], [0, 1, 0], [0, 0, 1]]), "focal.covariance: is no cov"),
        (lambda c: c["distortion"][1].pop("k1"), "distortion[1].k1: is missing"),
        (lambda c: c["distortion"][1].update(focal_length_mm=10.0), "distortion: has two entries for one"),
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


def test_a_camera_that_is_not_there_is_named(tmp_path: Path) -> None:
    """By its path."""
    with pytest.raises(CameraError, match=r"no.yaml: cannot be read: No such file"):
        camera_from_file(tmp_path / "no.yaml")
