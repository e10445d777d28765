"""A made-up room and what a lidar sees of it."""

from __future__ import annotations

import math

import numpy as np

from rosbot_patrol.geometry import Pose2D, Transform, compose
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.scan import LaserScan

# Walls as x0, y0, x1, y1 [m]: a room of 8 m x 6 m with a niche and a box in it.
ROOM = np.array(
    [
        (-4.0, -3.0, 4.0, -3.0),
        (4.0, -3.0, 4.0, 3.0),
        (4.0, 3.0, 1.0, 3.0),
        (1.0, 3.0, 1.0, 2.0),
        (1.0, 2.0, -4.0, 2.0),
        (-4.0, 2.0, -4.0, -3.0),
        (-2.5, -1.5, -2.0, -1.5),
        (-2.0, -1.5, -2.0, -1.0),
        (-2.0, -1.0, -2.5, -1.0),
        (-2.5, -1.0, -2.5, -1.5),
    ]
)
CORRIDOR = np.array([(-100.0, -1.0, 100.0, -1.0), (-100.0, 1.0, 100.0, 1.0)])


def ranges_at(pose: Pose2D, angles: np.ndarray, walls: np.ndarray = ROOM) -> np.ndarray:
    """Distance to the nearest wall in each direction, inf where there is none."""
    directions = np.column_stack((np.cos(pose.yaw + angles), np.sin(pose.yaw + angles)))
    start, along = walls[:, :2] - (pose.x, pose.y), walls[:, 2:] - walls[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = directions[:, None, 0] * along[None, :, 1] - directions[:, None, 1] * along[None, :, 0]
        far = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0])[None] / cross
        share = (start[None, :, 0] * directions[:, None, 1] - start[None, :, 1] * directions[:, None, 0]) / cross
    return np.where((far > 1e-9) & (share >= 0.0) & (share <= 1.0), far, np.inf).min(axis=1)


def scan_at(
    pose: Pose2D,
    *,
    stamp: float = 0.0,
    beams: int = 180,
    walls: np.ndarray = ROOM,
    mount: Transform | None = None,
    range_max: float = 20.0,
) -> LaserScan:
    """What the lidar measures where the robot stands, by a laser that may be mounted upside down."""
    mount = mount or Transform()
    is_upside_down = mount.rotation[2, 2] < 0.0
    increment = 2.0 * math.pi / beams
    angles = -math.pi + increment * np.arange(beams)
    seen = ranges_at(compose(pose, mount.pose), -angles if is_upside_down else angles, walls)
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-math.pi,
        angle_increment=increment,
        range_min=0.05,
        range_max=range_max,
        ranges=np.where(seen < range_max, seen, np.inf),
    )


def small(**changes: object) -> GmappingParams:
    """The tutorial's parameters on a small extent with few particles."""
    values: dict[str, object] = {
        "particles": 5,
        "linearUpdate": 0.05,
        "angularUpdate": 0.05,
        "maxUrange": 16.0,
        "xmin": -8.0,
        "ymin": -8.0,
        "xmax": 8.0,
        "ymax": 8.0,
    }
    return GmappingParams(**(values | changes))  # type: ignore[arg-type]
