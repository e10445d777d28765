"""Bags made for tests, by rosbags' writers."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rosbot_patrol.geometry import Pose2D, quaternion_from_yaw
from rosbot_patrol.grid import Grid
from rosbot_patrol.scan import LaserScan

NOETIC = get_typestore(Stores.ROS1_NOETIC)
NOETIC.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
FOXY = get_typestore(Stores.ROS2_FOXY)

SCAN, TF, MAP = "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage", "nav_msgs/msg/OccupancyGrid"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


class Maker:
    """Makes messages of one ROS version."""

    def __init__(self, *, is2: bool = False) -> None:
        self.is2, self.store = is2, FOXY if is2 else NOETIC

    def new(self, name: str, *values: Any) -> Any:
        return self.store.types[name](*values)

    def stamp(self, seconds: float) -> Any:
        whole = math.floor(seconds)
        return self.new("builtin_interfaces/msg/Time", whole, round((seconds - whole) * 1e9))

    def header(self, seconds: float, frame: str) -> Any:
        sequence = () if self.is2 else (0,)
        return self.new("std_msgs/msg/Header", *sequence, self.stamp(seconds), frame)

    def scan(self, scan: LaserScan) -> Any:
        last = scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1)
        bounds = (scan.angle_min, last, scan.angle_increment, 0.0, 0.1, scan.range_min, scan.range_max)
        ranges = scan.ranges.astype(np.float32)
        return self.new(SCAN, self.header(scan.stamp, scan.frame_id), *bounds, ranges, np.empty(0, np.float32))

    def transform(self, parent: str, child: str, seconds: float, place: Any, turn: Any) -> Any:
        found = self.new(
            "geometry_msgs/msg/Transform",
            self.new("geometry_msgs/msg/Vector3", *place),
            self.new("geometry_msgs/msg/Quaternion", *turn),
        )
        return self.new("geometry_msgs/msg/TransformStamped", self.header(seconds, parent), child, found)

    def planar(self, parent: str, child: str, seconds: float, pose: Pose2D) -> Any:
        return self.transform(parent, child, seconds, (pose.x, pose.y, 0.0), quaternion_from_yaw(pose.yaw))

    def tf(self, *transforms: Any) -> Any:
        return self.new(TF, list(transforms))

    def pose(self, pose: Pose2D) -> Any:
        return self.new(
            "geometry_msgs/msg/Pose",
            self.new("geometry_msgs/msg/Point", pose.x, pose.y, 0.0),
            self.new("geometry_msgs/msg/Quaternion", *quaternion_from_yaw(pose.yaw)),
        )

    def initial_pose(self, seconds: float, pose: Pose2D, variance: float = 0.01) -> Any:
        covariance = np.zeros((6, 6))
        covariance[[0, 1, 5], [0, 1, 5]] = variance
        found = self.new("geometry_msgs/msg/PoseWithCovariance", self.pose(pose), covariance.ravel())
        return self.new(POSE, self.header(seconds, "map"), found)

    def map(self, grid: Grid) -> Any:
        info, origin = grid.info, Pose2D(grid.info.origin_x, grid.info.origin_y, grid.info.yaw)
        place = (self.stamp(0.0), info.resolution, info.width, info.height, self.pose(origin))
        data = grid.cells.astype(np.int8).ravel()
        return self.new(MAP, self.header(0.0, "map"), self.new("nav_msgs/msg/MapMetaData", *place), data)

    def bytes(self, message: Any) -> bytes:
        name = message.__msgtype__
        made = self.store.serialize_cdr(message, name) if self.is2 else self.store.serialize_ros1(message, name)
        return bytes(made)


def write_bag(
    path: Path,
    messages: Iterable[tuple[float, str, Any]],
    *,
    is2: bool = False,
    compression: str = "",
    latching: Iterable[str] = (),
) -> Path:
    """Write (time recorded [s], topic, message) as a bag.

    Args:
        path: of the file or, for ROS 2, of the folder.
        messages: made by `Maker`.
        is2: a bag of ROS 2.
        compression: "", "BZ2" or "LZ4", of ROS 1 only.
        latching: topics that are latched, of ROS 1 only.
    """
    maker = Maker(is2=is2)
    writer: Any = Writer2(path, version=8) if is2 else Writer1(path)
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression])
    with contextlib.closing(writer):
        writer.open()
        connections: dict[str, Any] = {}
        for seconds, topic, message in messages:
            if topic not in connections:
                more = {} if is2 else {"latching": int(topic in set(latching)) or None}
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=maker.store, **more)
            writer.write(connections[topic], round(seconds * 1e9), maker.bytes(message))
    return path
