"""Planes: a dial's face as seen square on, and the plane above it in which its needles turn.

Seen from the camera, the needle's plane is the face's plane enlarged about the camera's foot, by the ratio of the
camera's distances from the face and from the needle. In each frame, the camera's place follows from the panel's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment, Point
from decoder.imaging.motion import carried, jacobian
from decoder.panel.arrays import Floats

Matrix = NDArray[np.float64]
# Each point of a picture gives two equations.
MIN_POINTS = 3  # of the panel determine a camera position, which has six unknowns
MIN_PAIRS = 4  # of points determine a plane-to-plane map, which has eight


@dataclass(frozen=True, slots=True)
class Raised:
    """A plane above the panel's.

    Attributes
    ----------
    height_inches
        Towards the camera.
    inches
        The nine elements of the matrix that carries inches on the panel to its picture, without distortion.
    """

    height_inches: float
    inches: tuple[float, ...]

    def px_at(self, point_px: tuple[float, float]) -> float:
        """Convert the height to pixels of the panel picture, at a point of it without distortion."""
        inches_a_pixel = jacobian(np.linalg.inv(np.array(self.inches).reshape(3, 3)), point_px)
        return float(self.height_inches / np.sqrt(abs(np.linalg.det(inches_a_pixel))))

    def seen_in(self, alignment: Alignment) -> Matrix:
        """(3, 3), on the panel picture: from a point's foot on the panel to where the camera sees the raised point.

        `alignment` must know the frame's lens.
        """
        if alignment.lens is None:
            return np.eye(3)
        inches = np.array(self.inches).reshape(3, 3)
        x, y, distance = camera_over_panel(np.linalg.inv(alignment.lens.matrix) @ alignment.matrix @ inches)
        enlarged = distance / (distance - self.height_inches)
        about = np.array([[enlarged, 0, x * (1 - enlarged)], [0, enlarged, y * (1 - enlarged)], [0, 0, 1.0]])
        return np.asarray(inches @ about @ np.linalg.inv(inches))


def camera_over_panel(normalised: Matrix) -> tuple[float, float, float]:
    """Find the camera's foot on a plane, and its distance from it, in the plane's units.

    Parameters
    ----------
    normalised : (3, 3) from the plane to normalised coordinates of the camera
    """
    size = np.sqrt(np.linalg.norm(normalised[:, 0]) * np.linalg.norm(normalised[:, 1]))
    columns = normalised / size
    left, _, right = np.linalg.svd(columns[:, :2], full_matrices=False)
    axes = left @ right  # the nearest two that are square to each other
    rotation = np.column_stack([axes, np.cross(axes[:, 0], axes[:, 1])])
    x, y, z = -rotation.T @ columns[:, 2]
    return float(x), float(y), abs(float(z))


@dataclass(frozen=True, slots=True)
class Squeeze:
    """An ellipse as which a circle appears: its diameters are as (1 + part) to (1 - part).

    `across` and `askew` are that part times the cosine and the sine of twice the angle of its longest diameter; `doubt`
    is the part's standard uncertainty, as far as it is known.
    """

    across: float
    askew: float
    doubt: float = 0.0

    @property
    def matrix(self) -> Matrix:
        """(2, 2): from a place on the dial to where it appears."""
        return np.array([[1.0 + self.across, self.askew], [self.askew, 1.0 - self.across]])

    @property
    def part(self) -> float:
        """By which part diameters are longer or shorter, at most."""
        return math.hypot(self.across, self.askew)

    @property
    def aside_deg(self) -> float:
        """The angle off axis from which a dial appears like that."""
        return math.degrees(math.acos((1.0 - self.part) / (1.0 + self.part)))

    @property
    def obliqueness(self) -> float:
        """The tangent of that angle."""
        return math.tan(math.radians(self.aside_deg))

    @property
    def turns_off_deg(self) -> float:
        """The root mean square error of a turn that is read on a dial that appears like that.

        The error of a turn from one angle to another, both from the longest diameter, is the part times the difference
        of the sines of twice these angles. All turns are assumed to begin where that is worst, as a flight's may.
        """
        return math.degrees(math.sqrt(1.5) * self.part)

    def square_on_deg(self, angle_deg: float) -> float:
        """Convert an angle as it appears to the dial's own, in the same turn."""
        x, y = self._square_on(angle_deg)
        return angle_deg + math.remainder(math.degrees(math.atan2(y, x)) - angle_deg, 360.0)

    def square_on_size(self, angle_deg: float) -> float:
        """Return how long a length of 1 is on the dial that appears at this angle."""
        return math.hypot(*self._square_on(angle_deg))

    def _square_on(self, angle_deg: float) -> tuple[float, float]:
        x, y = np.linalg.solve(self.matrix, [math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
        return float(x), float(y)


@dataclass(frozen=True, slots=True)
class DialPlane:
    """The dial's own plane, in pixels from the pivot, x to 0 degrees, y to 90 degrees, on the panel picture.

    `elements` are those of a (3, 3) matrix, row by row; the panel picture is without distortion.
    """

    elements: tuple[float, ...]

    @classmethod
    def of(cls, matrix: Floats) -> Self:
        """Make it with this matrix."""
        return cls(tuple((matrix / matrix[2, 2]).ravel().tolist()))

    @property
    def matrix(self) -> Matrix:
        """(3, 3)."""
        return np.array(self.elements).reshape(3, 3)

    def to_panel(self, points: Floats) -> Floats:
        """(2, N) points of the dial in the panel picture."""
        return carried(self.matrix, np.asarray(points, np.float64))

    @property
    def obliqueness(self) -> float:
        """The tangent of the angle from which the camera sees the dial at its pivot; 0 square on."""
        longest, shortest = np.linalg.svd(jacobian(self.matrix, (0.0, 0.0)), compute_uv=False)
        return float(np.sqrt(max((longest / shortest) ** 2 - 1.0, 0.0)))

    @property
    def perspective(self) -> float:
        """By which part something that is a pixel nearer to the camera appears larger."""
        return math.hypot(*self.elements[6:8])

    @classmethod
    def square_on(cls, centre: Point) -> Self:
        """Make the plane of a dial that is seen square on, without distortion."""
        return cls((1.0, 0.0, centre[0], 0.0, 1.0, centre[1], 0.0, 0.0, 1.0))

    def squeezed(self, squeeze: Squeeze) -> DialPlane:
        """Squeeze the plane about its pivot, as it appears."""
        whole = np.eye(3)
        whole[:2, :2] = squeeze.matrix
        return DialPlane.of(self.matrix @ whole)

    def around(self, offset_px: Point) -> DialPlane:
        """Move the plane's pivot to a point of it."""
        x, y = offset_px
        return DialPlane.of(self.matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]))
