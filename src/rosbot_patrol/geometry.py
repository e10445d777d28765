"""Poses and twists in the plane (REP 103: metres, radians, x forward, y left, counter-clockwise positive).

`a_from_b` is the pose of frame b in frame a, so `map_from_base = compose(map_from_odom, odom_from_base)`.
Functions named `*_poses` take arrays of shape (N, 3): x, y, yaw.
"""

from __future__ import annotations

import logging
import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

log = logging.getLogger(__name__)

Array = NDArray[np.float64]


class Pose2D(NamedTuple):
    """Position [m] and heading [rad] in the plane."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __matmul__(self, other: Pose2D) -> Pose2D:
        return compose(self, other)


class Transform(NamedTuple):
    """a_from_b in space: a position [m] and a quaternion of length 1."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    @property
    def pose(self) -> Pose2D:
        """The planar part, without roll and pitch; a laser's scan therefore needs `scan.level_scan`."""
        return Pose2D(self.x, self.y, yaw_from_quaternion(self.qx, self.qy, self.qz, self.qw))

    @property
    def rotation(self) -> Array:
        """Rotation matrix, shape (3, 3); the quaternion may have any length but zero."""
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        s = 2.0 / (x * x + y * y + z * z + w * w)
        return np.array(
            [
                [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
                [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
            ]
        )

    @property
    def matrix(self) -> Array:
        """Homogeneous matrix, shape (4, 4)."""
        out = np.eye(4)
        out[:3, :3] = self.rotation
        out[:3, 3] = self.x, self.y, self.z
        return out


class Twist2D(NamedTuple):
    """Velocity of a base: forward [m/s], sideways [m/s], turning [rad/s]."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0


STOP = Twist2D()


def wrap_angle(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_angles(angles: Array) -> Array:
    """`wrap_angle` for an array, in [-pi, pi)."""
    return (angles + math.pi) % math.tau - math.pi


def angle_difference(to: float, start: float) -> float:
    """The shortest turn from `start` to `to`, in (-pi, pi]."""
    return wrap_angle(to - start)


def compose(a_from_b: Pose2D, b_from_c: Pose2D) -> Pose2D:
    """Chain two poses: a_from_b and b_from_c give a_from_c."""
    c, s = math.cos(a_from_b.yaw), math.sin(a_from_b.yaw)
    return Pose2D(
        a_from_b.x + c * b_from_c.x - s * b_from_c.y,
        a_from_b.y + s * b_from_c.x + c * b_from_c.y,
        wrap_angle(a_from_b.yaw + b_from_c.yaw),
    )


def invert(a_from_b: Pose2D) -> Pose2D:
    """Inverse pose: a_from_b gives b_from_a."""
    c, s = math.cos(a_from_b.yaw), math.sin(a_from_b.yaw)
    return Pose2D(
        -c * a_from_b.x - s * a_from_b.y,
        s * a_from_b.x - c * a_from_b.y,
        wrap_angle(-a_from_b.yaw),
    )


def transform_points(a_from_b: Pose2D, points_b: Array) -> Array:
    """Points of frame b, shape (N, 2), in frame a."""
    c, s = math.cos(a_from_b.yaw), math.sin(a_from_b.yaw)
    rotation = np.array([[c, s], [-s, c]])
    points_a: Array = points_b @ rotation + np.array([a_from_b.x, a_from_b.y])
    return points_a


def compose_poses(a_from_b: Pose2D, poses_b: Array) -> Array:
    """Poses of frame b, shape (N, 3), in frame a."""
    out = np.empty_like(poses_b)
    out[:, :2] = transform_points(a_from_b, poses_b[:, :2])
    out[:, 2] = wrap_angles(poses_b[:, 2] + a_from_b.yaw)
    return out


def distance(a: Pose2D, b: Pose2D) -> float:
    """Distance between two positions [m]."""
    return math.hypot(a.x - b.x, a.y - b.y)


def driven(twist: Twist2D, times: Array) -> tuple[Array, Array, Array]:
    """Motion ahead, to the left and in heading after a constant velocity has held for some times, shape (T,) each."""
    angle = twist.wz * times
    if abs(twist.wz) < 1e-6:
        return twist.vx * times, twist.vy * times, angle
    s, c = np.sin(angle) / twist.wz, (1.0 - np.cos(angle)) / twist.wz
    return twist.vx * s - twist.vy * c, twist.vx * c + twist.vy * s, angle


def quaternion_from_yaw(yaw: float) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a turn about z."""
    return 0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)


def yaw_from_quaternion(x: float, y: float, z: float, w: float, *, what: str = "an orientation") -> float:
    """Heading of an orientation (roll and pitch are dropped) of any length.

    A quaternion of length 0 has heading 0, because Python fills new messages with zeros. It is logged once for each
    `what`.

    Args:
        x: part of the quaternion, as are y, z and w.
        y: likewise.
        z: likewise.
        w: likewise.
        what: whose orientation it is, for the warning.

    Raises:
        ValueError: the quaternion is not finite.
    """
    norm = x * x + y * y + z * z + w * w
    if not math.isfinite(norm):
        raise ValueError(f"({x}, {y}, {z}, {w}) is no orientation")
    if norm < 1e-12:
        _say_zeros(what)
        return 0.0
    return math.atan2(2.0 * (w * z + x * y) / norm, 1.0 - 2.0 * (y * y + z * z) / norm)


@cache
def _say_zeros(what: str) -> None:
    log.warning("%s is (0, 0, 0, 0), no quaternion: a heading of 0 is taken; its sender should set w to 1", what)
