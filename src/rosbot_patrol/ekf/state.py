"""The 15 numbers of the filter's state, and rotations between frames.

Position and orientation are in the world frame; velocities and accelerations in the frame of the base. Angles are roll,
pitch and yaw about fixed axes (REP 103).

Source: T. Moore and D. Stouch, "A Generalized Extended Kalman Filter Implementation for the Robot Operating System",
2014.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIZE = 15
POSITION, ORIENTATION, VELOCITY, TURNING, ACCELERATION = (slice(at, at + 3) for at in range(0, SIZE, 3))
POSE, TWIST = slice(0, 6), slice(6, 12)
Z, ROLL, PITCH, YAW = 2, 3, 4, 5
VZ, VROLL, VPITCH, AZ = 8, 9, 10, 14
NAMES = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az")
ANGLES = (ROLL, PITCH, YAW)
OFF_THE_PLANE = (Z, ROLL, PITCH, VZ, VROLL, VPITCH, AZ)


def wrap(angle: float) -> float:
    """The angle in -pi to pi [rad]."""
    return math.remainder(angle, math.tau)


def axis_rotations(roll: float, pitch: float, yaw: float) -> tuple[Array, Array, Array]:
    """Rotations about x, y and z, each of shape (3, 3)."""
    cr, sr, cp, sp, cy, sy = (each(angle) for angle in (roll, pitch, yaw) for each in (math.cos, math.sin))
    return (
        np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]]),
        np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]]),
        np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]]),
    )


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """The rotation by roll, then pitch, then yaw about fixed axes, shape (3, 3)."""
    about_x, about_y, about_z = axis_rotations(roll, pitch, yaw)
    return np.asarray(about_z @ about_y @ about_x)


def angles(matrix: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation [rad]."""
    sine = min(1.0, max(-1.0, -float(matrix[2, 0])))
    return (
        math.atan2(matrix[2, 1], matrix[2, 2]),
        math.asin(sine),
        math.atan2(matrix[1, 0], matrix[0, 0]),
    )


def from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """The rotation of a unit quaternion, shape (3, 3)."""
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def to_quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """The unit quaternion (x, y, z, w) of roll, pitch and yaw [rad]."""
    cr, sr, cp, sp, cy, sy = (each(angle / 2.0) for angle in (roll, pitch, yaw) for each in (math.cos, math.sin))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
