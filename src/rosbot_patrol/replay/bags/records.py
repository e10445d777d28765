"""Conversion of a bag's messages to plain records without ROS.

Messages come as bytes and as rosbags' objects, with fields named as in ROS 2 (stamp.sec, stamp.nanosec).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rosbot_patrol.amcl.initial_pose import PoseRecord
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, yaw_from_quaternion
from rosbot_patrol.grid import Grid, GridInfo, occupancy_grid
from rosbot_patrol.replay.bags import definitions, raw_ros1
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge

ANY = "*"


class MapRecord(NamedTuple):
    """A nav_msgs/OccupancyGrid and its frame."""

    grid: Grid
    frame: str


class Refused(NamedTuple):
    """A complete message with invalid contents; the nodes ignore it with a warning."""

    problem: str


@dataclass(frozen=True)
class Kind:
    """A message type that a replay can use.

    Attributes:
        convert: makes the record from rosbags' message.
        needed: fields that the definition must have.
        fast: makes the same record from ROS 1 bytes.
        md5: sum of the one definition that `fast` can read; ANY: the bytes do not matter.
    """

    convert: Callable[[Any], Any]
    needed: Mapping[str, str]
    fast: Callable[[bytes], Any] | None = None
    md5: str = ""


def stamp_of(stamp: Any) -> float:
    """Time of a message [s]."""
    return float(stamp.sec + stamp.nanosec / 1e9)


def scan_of(message: Any) -> LaserScan:
    """Convert sensor_msgs/LaserScan; a stamp of 0 means none (NaN)."""
    return LaserScan(
        stamp=stamp_of(message.header.stamp) or math.nan,
        frame_id=message.header.frame_id.lstrip("/"),
        angle_min=message.angle_min,
        angle_increment=message.angle_increment,
        range_min=message.range_min,
        range_max=message.range_max,
        ranges=np.array(message.ranges, dtype=np.float64),
    )


def edges_of(message: Any) -> list[Edge]:
    """Convert tf2_msgs/TFMessage."""
    return [_edge(each) for each in message.transforms]


def _edge(message: Any) -> Edge:
    header, t, q = message.header, message.transform.translation, message.transform.rotation
    stamp = stamp_of(header.stamp)
    return Edge(header.frame_id, message.child_frame_id, stamp, t.x, t.y, t.z, q.x, q.y, q.z, q.w)


def map_of(message: Any) -> MapRecord | Refused:
    """Convert nav_msgs/OccupancyGrid; Refused if its size or origin is invalid."""
    origin = _pose(message.info.origin, "the orientation of a map's origin in the bag")
    if isinstance(origin, Refused):
        return origin
    info = GridInfo(
        resolution=float(message.info.resolution),
        width=int(message.info.width),
        height=int(message.info.height),
        origin_x=origin.x,
        origin_y=origin.y,
        yaw=origin.yaw,
    )
    try:
        grid = occupancy_grid(info, message.data, "map")
    except MapError as err:
        return Refused(f"it {err.problem}")
    return MapRecord(grid, message.header.frame_id.lstrip("/"))


def pose_of(message: Any) -> PoseRecord | Refused:
    """Convert geometry_msgs/PoseWithCovarianceStamped; Refused if the pose is invalid."""
    pose = _pose(message.pose.pose, "the orientation of a pose in the bag")
    if isinstance(pose, Refused):
        return pose
    header = message.header
    covariance = np.array(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    return PoseRecord(header.frame_id.lstrip("/"), stamp_of(header.stamp), pose, covariance)


def _pose(message: Any, what: str) -> Pose2D | Refused:
    p, q = message.position, message.orientation
    if not (math.isfinite(p.x) and math.isfinite(p.y)):
        return Refused(f"({p.x}, {p.y}) is no position")
    try:
        return Pose2D(float(p.x), float(p.y), yaw_from_quaternion(q.x, q.y, q.z, q.w, what=what))
    except ValueError as err:
        return Refused(str(err))


_TRANSFORMS = Kind(edges_of, definitions.TRANSFORMS, raw_ros1.read_transforms, raw_ros1.TF_MD5)

KINDS: dict[str, Kind] = {
    "sensor_msgs/msg/LaserScan": Kind(scan_of, definitions.SCAN, raw_ros1.read_scan, raw_ros1.SCAN_MD5),
    "tf2_msgs/msg/TFMessage": _TRANSFORMS,
    "tf/msg/tfMessage": _TRANSFORMS,
    "nav_msgs/msg/OccupancyGrid": Kind(map_of, definitions.GRID),
    "geometry_msgs/msg/PoseWithCovarianceStamped": Kind(pose_of, definitions.POSE_ESTIMATE),
}
