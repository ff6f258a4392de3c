"""The face of a dial as the panel picture shows it: where its angles and radii lie there, and its needles' height.

A draft is rarely complete: any part of it that determines a plane is used; other dials count as seen square on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from pydantic import TypeAdapter, ValidationError

from decoder.imaging.alignment import Matrix
from decoder.imaging.dial_plane import dial_plane, inches_to_picture
from decoder.imaging.motion import carried, homography
from decoder.imaging.optics import Optics
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.planes import DialPlane, Raised
from decoder.panel.arrays import Floats
from decoder.panel.camera import Camera
from decoder.panel.description import Point, Positive, ReferencePoint
from decoder.panel.errors import DecoderError
from decoder.panel.gauge import Gauge
from decoder.panel.lens import Lens
from decoder.panel.panel import Panel
from decoder.setup.thresholds import MOST_LEFT

XY = tuple[float, float]

RING_POINTS = 24
# The number of points of a rim in a draft.
RIM_POINTS = 8

_REFERENCES = TypeAdapter(tuple[ReferencePoint, ...])
_LEVEL = TypeAdapter(tuple[Point, Point])
_LENGTH = TypeAdapter(Positive)
_RIM = TypeAdapter(tuple[Point, ...])

# A trial height, from which the displacement of needles in a picture is derived.
TRIED_INCHES = 0.1


@dataclass(frozen=True, slots=True)
class DrawnPlane:
    """A dial's plane, and the lens of the picture, if that distorts.

    Points of the dial are pixels from its centre, x to 0 degrees, y to 90.
    """

    plane: DialPlane
    lens: Lens | None = None

    @classmethod
    def square_on(cls, centre: XY) -> Self:
        """Return that of a dial that is not known to be oblique."""
        return cls(DialPlane((1.0, 0.0, centre[0], 0.0, 1.0, centre[1], 0.0, 0.0, 1.0)))

    def to_picture(self, points: Floats) -> Matrix:
        """(2, N) points of the dial as (2, N) pixels of the picture as taken."""
        there = np.asarray(self.plane.to_panel(points), np.float64)
        return there if self.lens is None else self.lens.distorted(there)

    def to_dial(self, points: Floats) -> Matrix:
        """(2, N) pixels of the picture as taken as (2, N) points of the dial."""
        straight = np.asarray(points, np.float64)
        if self.lens is not None:
            straight = self.lens.undistorted(straight)
        return carried(np.asarray(np.linalg.inv(self.plane.matrix), np.float64), straight)

    def place(self, angle_deg: float, radius_px: float) -> XY:
        """Convert a place of the dial to one in the picture."""
        angle = math.radians(angle_deg)
        x, y = self.to_picture(radius_px * np.array([[math.cos(angle)], [math.sin(angle)]]))[:, 0]
        return float(x), float(y)

    def polar(self, at: XY) -> tuple[float, float]:
        """Measure the angle, in (-180, 180] degrees, and the radius of a place in the picture."""
        x, y = self.to_dial(np.array(at, np.float64)[:, None])[:, 0]
        return math.degrees(math.atan2(y, x)), math.hypot(x, y)

    def around(self, at: XY) -> DrawnPlane:
        """Move the pivot to a place in the picture."""
        return self.moved(*self.to_dial(np.array(at, np.float64)[:, None])[:, 0])

    def moved(self, x: float, y: float) -> DrawnPlane:
        """Move the pivot to a point of the dial."""
        return DrawnPlane(self.plane.around((float(x), float(y))), self.lens)

    @property
    def centre(self) -> XY:
        """Where the pivot lies in the picture."""
        return self.place(0.0, 0.0)

    def ring(self, radius_px: float, count: int = RING_POINTS) -> Matrix:
        """(2, N): places in the picture all round the circle of one radius."""
        angles = np.arange(count) * (2 * np.pi / count)
        return self.to_picture(radius_px * np.stack([np.cos(angles), np.sin(angles)]))

    def matrix(self, radius_px: float) -> list[float]:
        """Return nine elements, row by row, from the dial to the picture as taken, for dials of this size.

        Within a dial, the lens's own bend is less than a hundredth of a pixel, so a plane-to-plane map suffices.
        """
        found = self.plane.matrix
        if self.lens is not None:
            angles = np.arange(RING_POINTS) * (2 * np.pi / RING_POINTS)
            circle = np.stack([np.cos(angles), np.sin(angles)])
            points = np.concatenate([circle * radius_px, circle * radius_px / 2], axis=1)
            found = homography(points, self.to_picture(points))
        return [float(each) for each in (found / found[2, 2]).ravel()]


@dataclass(frozen=True, slots=True)
class Planes:
    """How a draft's dials are seen, as far as the draft determines that.

    `inches` carries inches on the panel to its picture without distortion, (3, 3); None if it is not determined.
    """

    optics: Optics
    inches: Matrix | None

    @classmethod
    def of(cls, document: Mapping[str, Any], size_px: tuple[int, int], camera: Camera | None) -> Self:
        """Determine how a draft's dials are seen in a picture of that size."""
        focal_length_mm = _valid(_LENGTH, document.get("focal_length_mm"))
        panel = Panel.model_construct(
            reference_points=_valid(_REFERENCES, document.get("reference_points")) or (),
            level=_valid(_LEVEL, document.get("level")),
        )
        optics = Optics(size_px, focal_length_mm, camera)
        try:
            _ = optics.lens
        except DecoderError:  # the camera does not have this zoom, which the check of the whole draft reports
            optics = Optics(size_px, focal_length_mm, None)
        try:
            return cls(optics, inches_to_picture(panel.reference_points, panel.level, optics))
        except (DecoderError, np.linalg.LinAlgError):  # reference points that fit no plane, also reported there
            return cls(optics, None)

    def drawn(self, centre: XY, rim: object = None) -> DrawnPlane:
        """Find the plane of a dial; if that fails, the dial counts as unknown."""
        lens = self.optics.lens
        lens = lens if lens is not None and lens.distorts else None
        gauge = Gauge.model_construct(centre=centre, rim=_valid(_RIM, rim))
        try:
            plane = dial_plane(gauge, "", self.optics, self.inches)
        except (DecoderError, np.linalg.LinAlgError):
            plane = None
        if plane is None or not np.isfinite(plane.matrix).all():
            return DrawnPlane.square_on(centre)
        return DrawnPlane(plane, lens)

    def raised(self, height_inches: object) -> Raised | None:
        """Raise the panel's plane to needles at this height above their face; None if the draft has no such plane."""
        height = _valid(_LENGTH, height_inches)
        if height is None or self.inches is None or self.optics.lens is None:
            return None
        return _raised(height, self.inches)


def _raised(height_inches: float, inches: Matrix) -> Raised:
    return Raised(height_inches, tuple((inches / inches[2, 2]).ravel().tolist()))


def away(one_deg: float, other_deg: float) -> float:
    """Return how far an angle is from another one, degrees clockwise, in [-180, 180)."""
    return (one_deg - other_deg + 180.0) % 360.0 - 180.0


def rim_of(drawn: DrawnPlane, radius_px: float) -> list[list[float]]:
    """Return points all round a circle about the pivot, as in `rim` of a gauge."""
    return [[round(float(x), 3), round(float(y), 3)] for x, y in drawn.ring(radius_px, RIM_POINTS).T]


def mean_radius_px(drawn: DrawnPlane, places: Floats) -> float:
    """Return the mean distance of (2, N) places in the picture from the pivot, in the dial's pixels."""
    return float(np.hypot(*drawn.to_dial(places)).mean())


def _valid(adapter: TypeAdapter[Any], value: object) -> Any:  # noqa: ANN401 - of the adapter's own kind
    """Validate a part of a draft; None if it is incomplete."""
    if value is None or (isinstance(value, Sequence) and not value):
        return None
    try:
        return adapter.validate_python(value)
    except ValidationError:
        return None


def height_inches(source: PanelPictures, moved_px: XY | None) -> float | None:
    """Find the height that explains where the only gauge's needles turn; None if none does, or it is given.

    Parameters
    ----------
    source : a panel of one gauge
    moved_px : from the gauge's centre to where its needles turn, in the panel picture
    """
    (gauge,) = source.panel.gauges
    optics = source.optics
    inches = inches_to_picture(source.panel.reference_points, source.panel.level, optics)
    if moved_px is None or gauge.needle_height_inches or inches is None or optics.lens is None:
        return None
    foot = np.array(gauge.centre, np.float64)[:, None]
    raised = _raised(TRIED_INCHES, inches).seen_in(optics.own)
    straight = np.asarray(optics.straight(foot), np.float64)
    right, down = (float(each) / TRIED_INCHES for each in (carried(raised, straight) - straight)[:, 0])
    height = (moved_px[0] * right + moved_px[1] * down) / max(right**2 + down**2, 1e-9)
    left_px = math.hypot(moved_px[0] - height * right, moved_px[1] - height * down)
    if height <= 0 or left_px > MOST_LEFT * math.hypot(*moved_px):
        return None
    return round(height, 3)
