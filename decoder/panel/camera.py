"""The camera: what `camera.yaml` says of one camera's lens at all its zooms, validated once at the edge.

The calibration is made at one picture size and serves every size with the same field of view: a 2M picture (1616 x
1212) and an Original (4896 x 3672) differ only in scale. The format is described for its authors in
docs/calibration.md; `decode calibrate` writes it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from decoder.panel.arrays import NO_TRUTH, Number, at_most
from decoder.panel.description import FocalLength, Point, Strict, Text, parse_description
from decoder.panel.errors import CameraError
from decoder.panel.lens import BrownConrady, Distortion, DistortionModel, Lens, distortion_of
from decoder.panel.thresholds import FOCAL_TOLERANCE
from decoder.panel.vocabulary import CAMERA_FILE
from flight_file.untrusted import read_yaml_file

Side = Annotated[int, Field(ge=16), NO_TRUTH, at_most(1e6)]
Size = tuple[Side, Side]
Row = tuple[Number, Number, Number]


class Focal(Strict):
    """Pixels per radian over focal length: c0 + c1 f + c2 f^2, f in mm, at the calibration's picture size.

    `covariance` is of c0, c1, c2; `range_mm` the shortest and the longest focal length that was photographed.
    """

    pixels_per_radian: Row
    """c0, c1, c2 of c0 + c1 f + c2 f^2, f in mm."""
    covariance: tuple[Row, Row, Row] | None = None
    """Of c0, c1, c2, from the fit; not known if left out."""
    range_mm: tuple[FocalLength, FocalLength]
    """The shortest and the longest focal length that was photographed."""

    @field_validator("covariance")
    @classmethod
    def _covariance_is_one(cls, covariance: tuple[Row, Row, Row] | None) -> tuple[Row, Row, Row] | None:
        if covariance is not None:
            matrix = np.array(covariance)
            spread = np.sqrt(np.abs(np.diag(matrix)))
            scaled = matrix / np.outer(spread, spread).clip(np.finfo(float).tiny)
            if np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max() or np.linalg.eigvalsh(scaled)[0] < -1e-6:  # noqa: PLR2004
                raise ValueError("is no covariance: it must be symmetric, and no variance below zero")
        return covariance

    @model_validator(mode="after")
    def _grows(self) -> Self:
        low, high = self.range_mm
        if low > high:
            raise ValueError("range_mm must run from the shortest focal length to the longest")
        values = [self.at(low * (high / low) ** step) for step in np.linspace(0, 1, 65)]
        if values[0] <= 0 or any(after < before for before, after in pairwise(values)):
            raise ValueError("pixels_per_radian must be positive and grow with the focal length over all of range_mm")
        return self

    def at(self, focal_length_mm: float) -> float:
        """Pixels per radian at a focal length."""
        c0, c1, c2 = self.pixels_per_radian
        return c0 + focal_length_mm * (c1 + focal_length_mm * c2)

    def sigma(self, focal_length_mm: float) -> float:
        """Compute the standard uncertainty of `at`, 0 if no covariance is given."""
        if self.covariance is None:
            return 0.0
        powers = np.array([1.0, focal_length_mm, focal_length_mm**2])
        return float(np.sqrt(max(powers @ np.array(self.covariance) @ powers, 0.0)))


_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
COEFFICIENTS = {
    DistortionModel.BROWN_CONRADY: _KEYS[:5],
    DistortionModel.RATIONAL: _KEYS,
    DistortionModel.FISHEYE: ("k1", "k2", "k3", "k4"),
}
"""The keys of each model's coefficients, in OpenCV's order."""


class DistortionEntry(Strict):
    """The lens's distortion at one focal length, in OpenCV's normalised coordinates."""

    focal_length_mm: FocalLength
    """The zoom that this is about; in between it is interpolated."""
    model: Literal["brown_conrady", "rational", "fisheye"] = "brown_conrady"
    """`rational` divides Brown-Conrady's polynomial by one of k4, k5, k6; `fisheye` is equidistant but for k1 to k4."""
    k1: Number
    """Radial: a tangent r off the axis appears at r + k1 r^3 + k2 r^5 + k3 r^7; of `fisheye` r is the angle."""
    k1_sigma: Annotated[float, Field(ge=0, allow_inf_nan=False), NO_TRUTH, at_most(1e12)] | None = None
    """Its standard uncertainty."""
    k2: Number = 0.0
    """Radial."""
    p1: Number = 0.0
    """Tangential."""
    p2: Number = 0.0
    """Tangential."""
    k3: Number = 0.0
    """Radial."""
    k4: Number = 0.0
    """Of `rational`: the divisor is 1 + k4 r^2 + k5 r^4 + k6 r^6. Of `fisheye`: radial."""
    k5: Number = 0.0
    """Of `rational`."""
    k6: Number = 0.0
    """Of `rational`."""

    @model_validator(mode="after")
    def _has_what_its_model_has(self) -> Self:
        known = COEFFICIENTS[DistortionModel(self.model)]
        foreign = [key for key in _KEYS if key not in known and getattr(self, key)]
        if foreign:
            raise ValueError(f"model {self.model} has no {foreign[0]}; it has {', '.join(known)}")
        return self


class Camera(Strict):
    """One camera. `distortion` is in order of focal length; none means a lens whose distortion is negligible."""

    model: Text = ""
    """As EXIF calls it; for people."""
    picture_size: Size
    """Width and height of the pictures it was made from, pixels; serves every size of the same shape."""
    principal_point: Point | None = None
    """Where the axis meets the picture; its middle if left out."""
    focal: Focal
    """Pixels per radian over focal length."""
    distortion: Annotated[tuple[DistortionEntry, ...], Field(max_length=1000)] = ()
    """One for each zoom it was measured at; none means a lens whose distortion is negligible."""

    @field_validator("distortion")
    @classmethod
    def _one_for_each_zoom(cls, distortion: tuple[DistortionEntry, ...]) -> tuple[DistortionEntry, ...]:
        ordered = sorted(distortion, key=lambda entry: entry.focal_length_mm)
        if any(before.focal_length_mm == after.focal_length_mm for before, after in pairwise(ordered)):
            raise ValueError("has two entries for one focal length; keep one")
        if len({entry.model for entry in ordered}) > 1:
            raise ValueError("has entries of two models; between them nothing can be interpolated")
        return tuple(ordered)

    @model_validator(mode="after")
    def _principal_point_is_inside(self) -> Self:
        (x, y), (width, height) = self.middle_px, self.picture_size
        if not (0 <= x <= width - 1 and 0 <= y <= height - 1):
            raise ValueError("principal_point lies outside the picture")
        return self

    @property
    def middle_px(self) -> tuple[float, float]:
        """The principal point at the calibration's picture size; the picture's middle unless it was measured."""
        width, height = self.picture_size
        return self.principal_point or ((width - 1) / 2, (height - 1) / 2)

    @property
    def only_focal_length_mm(self) -> float | None:
        """That of a lens that does not zoom; None if it does."""
        low, high = self.focal.range_mm
        return low if low == high else None

    def covers(self, focal_length_mm: float) -> bool:
        """Whether the calibration is valid at this focal length, up to the rounding of EXIF."""
        low, high = self.focal.range_mm
        return low * (1 - FOCAL_TOLERANCE) <= focal_length_mm <= high * (1 + FOCAL_TOLERANCE)

    def lens(self, focal_length_mm: float, size_px: tuple[int, int]) -> Lens:
        """Make the lens at one zoom, in the pixels of pictures of one size.

        Between two focal lengths at which the distortion was measured its coefficients are interpolated linearly;
        beyond the outermost ones they stay constant.

        Parameters
        ----------
        focal_length_mm : from the picture's EXIF
        size_px : the picture's width and height; any size with the calibration's aspect

        Raises
        ------
        CameraError
            For a focal length outside the calibration, or a picture of another aspect.
        """
        if not self.covers(focal_length_mm):
            low, high = self.focal.range_mm
            raise CameraError(
                "focal.range_mm",
                f"the calibration covers {low:g} to {high:g} mm, the picture was taken at {focal_length_mm:g} mm;"
                " calibrate with photographs at that zoom too",
            )
        scale = self._scale(size_px)
        x, y = self.middle_px
        lens = Lens(
            size_px=size_px,
            principal_point_px=((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5),
            pixels_per_radian=self.focal.at(focal_length_mm) * scale,
            pixels_per_radian_sigma=self.focal.sigma(focal_length_mm) * scale,
            distortion=self._distortion(focal_length_mm),
        )
        if not lens.reaches_corners():
            raise CameraError(
                "distortion",
                f"at {focal_length_mm:g} mm it folds the picture over before its corners; measure it again",
            )
        return lens

    def _scale(self, size_px: tuple[int, int]) -> float:
        (width, height), (own_width, own_height) = size_px, self.picture_size
        scale = width / own_width
        if abs(height - own_height * scale) > 1:
            raise CameraError(
                "picture_size",
                f"the calibration is for pictures shaped like {own_width} x {own_height}, this one is"
                f" {width} x {height}; calibrate with pictures of that shape",
            )
        return scale

    def _distortion(self, focal_length_mm: float) -> Distortion:
        if not self.distortion:
            return BrownConrady()
        at, model = [entry.focal_length_mm for entry in self.distortion], DistortionModel(self.distortion[0].model)
        columns = ([getattr(entry, key) for entry in self.distortion] for key in COEFFICIENTS[model])
        return distortion_of(model, [float(np.interp(focal_length_mm, at, column)) for column in columns])


def parse_camera(text: bytes | str, *, source: str = CAMERA_FILE) -> Camera:
    """Parse a camera's YAML.

    Raises
    ------
    CameraError
        Naming the path of the first wrong value, such as `focal.range_mm`.
    """
    return parse_description(Camera, text, error=CameraError, thing="camera", page="docs/calibration.md", source=source)


def camera_from_file(path: Path) -> Camera:
    """Read a camera's file.

    Raises
    ------
    CameraError
        If the file cannot be read or is wrong.
    """
    try:
        text = read_yaml_file(path)
    except OSError as error:
        raise CameraError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    return parse_camera(text, source=str(path))
