"""The optics of one flight: the lens of the panel picture, the lens of a frame, and the zoom between them.

Without a camera, a picture is assumed to be free of distortion, and scaled by the focal length in its EXIF.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from decoder.imaging.alignment import IDENTITY, Alignment, Matrix
from decoder.imaging.thresholds import MAX_ENLARGEMENT
from decoder.panel.arrays import Floats
from decoder.panel.camera import Camera
from decoder.panel.errors import CameraError, PictureError
from decoder.panel.lens import Lens

Size = tuple[int, int]
"""Width and height in pixels."""

# Sizes rounded by a camera differ in shape by up to this; cropped pictures, whose position in the whole is unknown, by
# more.
SHAPE_TOLERANCE = 0.004


@dataclass(frozen=True, slots=True)
class Optics:
    """How the panel picture and the frames of a flight were taken.

    Attributes
    ----------
    size_px
        Of the panel picture.
    stated_mm
        The focal length at which the panel picture was taken, if the panel states it.
    camera
        If known.
    """

    size_px: Size
    stated_mm: float | None = None
    camera: Camera | None = None

    @property
    def focal_length_mm(self) -> float | None:
        """At which the panel picture was taken, if known; for a camera without zoom, the only one it has."""
        if self.stated_mm is None and self.camera is not None:
            return self.camera.only_focal_length_mm
        return self.stated_mm

    @property
    def lens(self) -> Lens | None:
        """That of the panel picture; None if camera or focal length are unknown.

        Raises
        ------
        CameraError
            If the camera's calibration does not cover it.
        """
        if self.camera is None or self.focal_length_mm is None:
            return None
        return self.camera.lens(self.focal_length_mm, self.size_px)

    @property
    def shortcoming(self) -> str | None:
        """What cannot be used, as a sentence; None if nothing."""
        if self.camera is not None and self.camera.distortion and self.focal_length_mm is None:
            return "the lens's distortion is left in: give the panel picture's `focal_length_mm` in panel.yaml"
        return None

    def frame_lens(self, focal_length_mm: float | None, size_px: Size) -> Lens | None:
        """Return that of a frame; a frame without a focal length has the panel picture's.

        Raises
        ------
        PictureError
            If the camera's calibration does not cover it.
        """
        if self.camera is None or self.focal_length_mm is None:
            return None
        try:
            return self.camera.lens(focal_length_mm or self.focal_length_mm, size_px)
        except CameraError as error:
            raise PictureError(error.problem) from error

    @property
    def own(self) -> Alignment:
        """The alignment of the panel picture with itself, as taken."""
        return Alignment.of(np.eye(3), 1.0, lens=self.lens) if self.lens is not None else IDENTITY

    def straight(self, points: Floats) -> Floats:
        """(2, N) points of the panel picture, as taken, with distortion removed."""
        lens = self.lens
        return points if lens is None or not lens.distorts else lens.undistorted(points.astype(np.float64))

    def zoom(self, focal_length_mm: float | None, size_px: Size) -> Matrix:
        """(3, 3): from the panel picture to a picture of this focal length and size from the same place.

        Raises
        ------
        PictureError
            If the frame has quite another size or zoom, or the camera's calibration does not cover it, nor its shape.
        """
        (width, height), (own_width, own_height) = size_px, self.size_px
        part = width / own_width
        # Without a camera it does not matter where a picture was cropped: the search starts from its middle.
        tolerance = math.inf if self.camera is None else SHAPE_TOLERANCE
        same_shape = abs(height / (own_height * part) - 1.0) <= tolerance
        if not same_shape or not 1 / MAX_ENLARGEMENT <= part <= MAX_ENLARGEMENT:
            raise PictureError(f"the picture is {width} x {height}, the panel's {own_width} x {own_height}")
        own_lens, lens = self.lens, self.frame_lens(focal_length_mm, size_px)
        if own_lens is not None and lens is not None:
            return np.asarray(lens.matrix @ np.linalg.inv(own_lens.matrix))
        scale = part
        if self.focal_length_mm is not None and focal_length_mm is not None:
            zoomed = focal_length_mm / self.focal_length_mm
            if not 1 / MAX_ENLARGEMENT <= zoomed <= MAX_ENLARGEMENT:
                raise PictureError(
                    f"the picture was taken at {focal_length_mm:g} mm, the panel's at {self.focal_length_mm:g} mm"
                )
            scale *= zoomed
        x, y = (own_width - 1) / 2, (own_height - 1) / 2
        return np.array(
            [[scale, 0.0, (width - 1) / 2 - scale * x], [0.0, scale, (height - 1) / 2 - scale * y], [0.0, 0.0, 1.0]]
        )
