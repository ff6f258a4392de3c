"""Camera poses made of a place and of angles, for what tests draw."""

from __future__ import annotations

import math

import numpy as np

from decoder.imaging.camera_pose import Matrix, Pose


def pose_at(
    position_inches: tuple[float, float, float], attitude_deg: tuple[float, float, float], *, y_up: bool = False
) -> Pose:
    """Make the pose with this `position_inches` and `attitude_deg`."""
    roll, pitch, yaw = (math.radians(angle) for angle in attitude_deg)
    about_y = _turn(yaw, 2, 0)
    about_x = _turn(pitch, 1, 2)
    about_z = _turn(roll, 0, 1)
    rotation = (about_y @ about_x @ about_z).T
    x, y, distance = position_inches
    return Pose(rotation, -rotation @ np.array([x, -y if y_up else y, -distance]), y_up)


def _turn(angle_rad: float, first: int, second: int) -> Matrix:
    """Make the turn that takes axis `first` towards axis `second`."""
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = math.cos(angle_rad)
    matrix[second, first] = math.sin(angle_rad)
    matrix[first, second] = -math.sin(angle_rad)
    return matrix
