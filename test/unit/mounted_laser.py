"""What a laser measures in a room, however it is mounted on the robot."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.geometry import Pose2D, Transform, compose
from rosbot_patrol.scan import LaserScan

BEAMS = 720
RADIUS = 0.12  # of a post [m]


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """(x, y, z, w) of turns about the fixed axes x, y, z, in this order (REP 103)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2.0), math.sin(a / 2.0)) for a in (roll, pitch, yaw))
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    return x, y, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy


def mounted(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Transform:
    """base_from_laser."""
    return Transform(0.1, -0.05, 0.2, *quaternion(roll, pitch, yaw))


MOUNTS = {
    "upright": mounted(),
    "backwards": mounted(yaw=math.pi),
    "roll pi": mounted(roll=math.pi),
    "pitch pi": mounted(pitch=math.pi),
    "upside down and askew": mounted(roll=math.pi, yaw=0.7),
    "tilted by 3 deg": mounted(pitch=0.052, yaw=-2.0),
    "upside down, tilted by 5 deg": mounted(roll=math.pi - 0.087, yaw=0.3),
}


def on_map(map_from_base: Pose2D, base_from_laser: Transform) -> Transform:
    """map_from_laser."""
    place = compose(map_from_base, Pose2D(base_from_laser.x, base_from_laser.y))
    half = map_from_base.yaw / 2.0
    s, c = math.sin(half), math.cos(half)
    qx, qy, qz, qw = base_from_laser[3:]
    turned = c * qx - s * qy, c * qy + s * qx, c * qz + s * qw, c * qw - s * qz
    return Transform(place.x, place.y, base_from_laser.z, *turned)


def measure(
    place: Transform,
    walls: np.ndarray,
    posts: list[tuple[float, float]] | None = None,
    *,
    stamp: float = 10.0,
    range_max: float = 12.0,
) -> LaserScan:
    """A scan of wall segments, shape (N, 4), and of posts, from a laser at a place in their frame."""
    angles = -math.pi + math.tau / BEAMS * np.arange(BEAMS)
    ux, uy, _ = place.rotation[:, :2] @ np.stack((np.cos(angles), np.sin(angles)))
    share = np.hypot(ux, uy)
    ux, uy = ux / share, uy / share
    away = np.full(BEAMS, math.inf)
    for ax, ay, bx, by in walls - np.array([place.x, place.y] * 2):
        dx, dy = bx - ax, by - ay
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (ax * dy - ay * dx) / (ux * dy - uy * dx)
            at = (ax * uy - ay * ux) / (ux * dy - uy * dx)
        hit = (along > 0.0) & (at >= 0.0) & (at <= 1.0)
        away[hit] = np.minimum(away[hit], along[hit])
    for x, y in posts or []:
        ahead = (x - place.x) * ux + (y - place.y) * uy
        aside = (x - place.x) * uy - (y - place.y) * ux
        hit = (ahead > 0.0) & (np.abs(aside) < RADIUS)
        near = ahead[hit] - np.sqrt(RADIUS**2 - aside[hit] ** 2)
        away[hit] = np.minimum(away[hit], near)
    ranges = np.where(away <= range_max, away / share, math.inf)
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=math.tau / BEAMS,
        range_min=0.05,
        range_max=range_max,
        ranges=ranges,
    )
