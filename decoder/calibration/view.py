"""A view of the panel: where the camera is and how it is turned, and what follows for a point of the panel.

Two frames of axes are used, both right-handed. The camera's: x right, y down, z forward, as OpenCV has it. The panel's,
inside: x right, y down, z into the panel, in inches, so that a camera that is square on is not turned at all. Outside,
the panel's points are as their writer gave them, x right, y up or down, and heights grow towards the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.lens import Lens

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Camera position and attitude.

    Attributes
    ----------
    rotation
        (3, 3) from the panel's axes (inside) to the camera's.
    translation_inches
        (3,) the panel's origin in the camera's axes.
    y_up
        Whether the writer of the panel's points counts y upwards.
    """

    rotation: Matrix
    translation_inches: Matrix
    y_up: bool = False

    @property
    def position_inches(self) -> tuple[float, float, float]:
        """The camera: x and y as the panel's writer counts them, and its distance from the panel's plane."""
        x, y, z = (float(value) for value in -self.rotation.T @ self.translation_inches)
        return x, -y if self.y_up else y, -z

    @property
    def attitude_deg(self) -> tuple[float, float, float]:
        """Roll (clockwise, behind the camera), pitch (upwards), yaw (to the right); all 0 for a camera square on.

        The camera is first turned by yaw, then pitched about its own new x axis, then rolled about its optical axis.
        """
        turned = self.rotation.T
        roll = math.atan2(turned[1, 0], turned[1, 1])
        pitch = -math.asin(float(np.clip(turned[1, 2], -1, 1)))
        yaw = math.atan2(turned[0, 2], turned[2, 2])
        return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)

    @property
    def tilt_deg(self) -> float:
        """The angle between the optical axis and the panel's normal: how far from square on."""
        return math.degrees(math.acos(float(np.clip(self.rotation[2, 2], -1, 1))))

    def homography(self, lens: Lens, height_inches: float = 0.0) -> Matrix:
        """(3, 3) from (x, y, 1) in inches, as written, at a height above the panel, to undistorted pixels."""
        flip = -1.0 if self.y_up else 1.0
        right, down, inwards = self.rotation.T
        shifted = self.translation_inches - height_inches * inwards
        return np.asarray(lens.matrix @ np.column_stack([right, flip * down, shifted]))

    def pixels(self, points_inches: Matrix, lens: Lens) -> Matrix:
        """Where the picture shows points of the panel.

        Parameters
        ----------
        points_inches : (N, 2) on the panel, or (N, 3) with heights towards the camera

        Returns
        -------
        (N, 2) pixels of the picture as taken, distortion included
        """
        seen = self.rotation @ inside(points_inches, y_up=self.y_up).T + self.translation_inches[:, None]
        return lens.distorted(lens.pixels(seen[:2] / seen[2])).T


def inside(points_inches: Matrix, *, y_up: bool) -> Matrix:
    """(N, 3): points as written, (N, 2) or (N, 3), in the panel's inner axes."""
    points = np.asarray(points_inches, np.float64)
    if points.shape[1] == 2:  # noqa: PLR2004 - two coordinates
        points = np.column_stack([points, np.zeros(len(points))])
    return np.asarray(points * [1.0, -1.0 if y_up else 1.0, -1.0])


def pose_at(
    position_inches: tuple[float, float, float], attitude_deg: tuple[float, float, float], *, y_up: bool = False
) -> Pose:
    """The pose with this `position_inches` and `attitude_deg`."""
    roll, pitch, yaw = (math.radians(angle) for angle in attitude_deg)
    about_y = _turn(yaw, 2, 0)
    about_x = _turn(pitch, 1, 2)
    about_z = _turn(roll, 0, 1)
    rotation = (about_y @ about_x @ about_z).T
    x, y, distance = position_inches
    return Pose(rotation, -rotation @ np.array([x, -y if y_up else y, -distance]), y_up)


def rotation_by(vector_rad: Matrix) -> Matrix:
    """(3, 3): the turn about a (3,) axis by its length in radians (Rodrigues)."""
    x, y, z = vector_rad
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.sqrt(x * x + y * y + z * z)
    first = math.sin(angle) / angle if angle > 1e-8 else 1.0  # noqa: PLR2004 - below it the series is exact
    second = (math.sin(angle / 2) / angle) ** 2 * 2 if angle > 1e-8 else 0.5  # noqa: PLR2004
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross)


def _turn(angle_rad: float, first: int, second: int) -> Matrix:
    """The turn that takes axis `first` towards axis `second`."""
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = math.cos(angle_rad)
    matrix[second, first] = math.sin(angle_rad)
    matrix[first, second] = -math.sin(angle_rad)
    return matrix
