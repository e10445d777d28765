"""A planar laser scan as a plain record."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.geometry import Pose2D, yaw_from_quaternion

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LaserScan:
    """One sweep (sensor_msgs/LaserScan without its header's frame handling).

    Attributes:
        stamp: time of the first ray [s].
        frame_id: frame of the sensor; angle 0 is its x axis, counter-clockwise positive.
        angle_min: angle of the first beam [rad]; angle_increment: from beam to beam [rad].
        range_min, range_max: beams outside are no measurement [m].
        ranges: beam lengths [m], shape (N,), inf where nothing was hit.
    """

    stamp: float
    frame_id: str
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: Array

    @property
    def angles(self) -> Array:
        """Angle of each beam [rad], shape (N,)."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))

    @property
    def is_hit(self) -> NDArray[np.bool_]:
        """Which beams measured something, shape (N,)."""
        with np.errstate(invalid="ignore"):
            return np.isfinite(self.ranges) & (self.ranges >= self.range_min) & (self.ranges <= self.range_max)


@dataclass(frozen=True)
class Mount:
    """How the laser sits on the robot: its pose, and whether it hangs upside down."""

    pose: Pose2D = Pose2D()
    is_upside_down: bool = False


def level_mount(x: float, y: float, quaternion: tuple[float, float, float, float]) -> Mount:
    """The mount of a laser that stands at x, y [m] of the robot, turned by a quaternion of length 1.

    Raises:
        ValueError: the laser does not look along the floor.
    """
    qx, qy, qz, qw = quaternion
    upright = 1.0 - 2.0 * (qx * qx + qy * qy)  # z component of the sensor's z axis
    if abs(upright) < 0.9:
        raise ValueError("the laser is not mounted level, its scan is no plan of the room")
    return Mount(Pose2D(x, y, yaw_from_quaternion(qx, qy, qz, qw)), upright < 0.0)


def scan_problem(scan: LaserScan) -> str:
    """Why a scan cannot be used at all, "" where it can."""
    if not len(scan.ranges):
        return "it has no beams"
    if not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment) and math.isfinite(scan.stamp)):
        return f"its angles make no sense (angle_min {scan.angle_min}, angle_increment {scan.angle_increment})"
    if not (scan.range_max > 0.0 and math.isfinite(scan.range_max) and math.isfinite(scan.range_min)):
        return f"its bounds make no sense (range_min {scan.range_min}, range_max {scan.range_max})"
    return ""


def scan_points(scan: LaserScan) -> Array:
    """End points of the beams that hit, in the sensor's frame [m], shape (N, 2)."""
    hit = scan.is_hit
    lengths, angles = scan.ranges[hit], scan.angles[hit]
    return np.column_stack((lengths * np.cos(angles), lengths * np.sin(angles)))


def is_silent_range(distance: float) -> bool:
    """Whether a range sensor's reading says nothing: NaN, or the negative number of a broken one (-inf is too near)."""
    return math.isnan(distance) or (math.isfinite(distance) and distance < 0.0)
