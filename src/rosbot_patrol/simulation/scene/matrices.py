"""Conversion of homogeneous matrices, shape (4, 4), from and to the forms of files and planar code."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D

Matrix = NDArray[np.float64]


def from_xyz_rpy(xyz: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Matrix:
    """The pose of SDF's <pose> and URDF's <origin>: rotations about the fixed axes x, then y, then z."""
    cr, sr = math.cos(rpy[0]), math.sin(rpy[0])
    cp, sp = math.cos(rpy[1]), math.sin(rpy[1])
    cy, sy = math.cos(rpy[2]), math.sin(rpy[2])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def from_pose2d(pose: Pose2D, z: float = 0.0) -> Matrix:
    """A planar pose at a height [m]."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([[c, -s, 0.0, pose.x], [s, c, 0.0, pose.y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])


def to_pose2d(matrix: Matrix) -> Pose2D:
    """The planar part of a pose."""
    return Pose2D(float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0]))


def to_quaternion(matrix: Matrix) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w) of the rotation."""
    r = matrix[:3, :3]
    trace = float(np.trace(r))
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        x, y, z = ((r[2, 1] - r[1, 2]) / s, (r[0, 2] - r[2, 0]) / s, (r[1, 0] - r[0, 1]) / s)
        return float(x), float(y), float(z), s / 4.0
    i = int(np.argmax(np.diag(r)))
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * math.sqrt(max(1.0 + r[i, i] - r[j, j] - r[k, k], 1e-12))
    q4 = [0.0, 0.0, 0.0, float(r[k, j] - r[j, k]) / s]
    q4[i] = s / 4.0
    q4[j] = float(r[j, i] + r[i, j]) / s
    q4[k] = float(r[k, i] + r[i, k]) / s
    return q4[0], q4[1], q4[2], q4[3]


def is_upright(matrix: Matrix) -> bool:
    """Whether the z axis is vertical, up or down."""
    return abs(abs(float(matrix[2, 2])) - 1.0) < 1e-9
