"""Conversion of move_base's input messages to plain records without ROS."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rosbot_patrol.costmap.records import CloudRecord, DepthRecord, OpticsRecord, RangeRecord
from rosbot_patrol.costmap.sources.cloud import CloudLayout
from rosbot_patrol.costmap.sources.depth import Optics
from rosbot_patrol.geometry import Pose2D, Twist2D, yaw_from_quaternion
from rosbot_patrol.replay.bags import records
from rosbot_patrol.replay.bags.definitions import STAMP
from rosbot_patrol.replay.bags.records import Kind, Refused

LEVEL = 1e-3  # largest deviation of the goal's z axis from vertical, as a cosine


class GoalPoseRecord(NamedTuple):
    """move_base_msgs/MoveBaseActionGoal: id, frame and pose."""

    goal: str
    frame: str
    pose: Pose2D


class CancelRecord(NamedTuple):
    """actionlib_msgs/GoalID on move_base/cancel: id of the goal, "" for all."""

    goal: str


class VelocityRecord(NamedTuple):
    """nav_msgs/Odometry: the robot's velocity."""

    twist: Twist2D


def _goal(message: Any) -> GoalPoseRecord | Refused:
    target = message.goal.target_pose
    p, q = target.pose.position, target.pose.orientation
    length = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not (math.isfinite(length) and length >= 1e-6 and math.isfinite(p.x) and math.isfinite(p.y)):
        return Refused("the goal is no pose")
    if abs(2.0 * (q.x * q.x + q.y * q.y) / length) > LEVEL:
        return Refused("the goal's z axis does not point up")
    pose = Pose2D(float(p.x), float(p.y), yaw_from_quaternion(q.x, q.y, q.z, q.w))
    return GoalPoseRecord(message.goal_id.id, target.header.frame_id.lstrip("/"), pose)


def _velocity(message: Any) -> VelocityRecord:
    twist = message.twist.twist
    return VelocityRecord(Twist2D(float(twist.linear.x), float(twist.linear.y), float(twist.angular.z)))


def _cloud(message: Any) -> CloudRecord:
    fields = {field.name: (int(field.offset), int(field.datatype)) for field in message.fields}
    steps = int(message.point_step), int(message.row_step)
    layout = CloudLayout(int(message.width), int(message.height), fields, *steps, bool(message.is_bigendian))
    return CloudRecord(*_stamped(message), message.data, layout)


def _depth(message: Any) -> DepthRecord:
    stamp, frame = _stamped(message)
    return DepthRecord(
        stamp=stamp,
        frame=frame,
        width=int(message.width),
        height=int(message.height),
        encoding=message.encoding,
        step=int(message.step),
        data=message.data,
        is_bigendian=bool(message.is_bigendian),
    )


def _optics(message: Any) -> OpticsRecord:
    k = message.K if hasattr(message, "K") else message.k  # names in ROS 1 and ROS 2
    return OpticsRecord(int(message.width), int(message.height), Optics(*(float(k[i]) for i in (0, 4, 2, 5))))


def _range(message: Any) -> RangeRecord:
    limits = float(message.min_range), float(message.max_range)
    return RangeRecord(*_stamped(message), float(message.range), *limits, float(message.field_of_view))


def _stamped(message: Any) -> tuple[float, str]:
    return records.stamp_of(message.header.stamp), message.header.frame_id.lstrip("/")


_TARGET = "goal.target_pose"
_BYTES = {"height": "int", "width": "int", "is_bigendian": "int", "data": "int[]"}

KINDS: dict[str, Kind] = {
    **records.KINDS,
    "move_base_msgs/msg/MoveBaseActionGoal": Kind(
        _goal,
        {"goal_id.id": "string", f"{_TARGET}.header.frame_id": "string"}
        | {f"{_TARGET}.pose.position.{axis}": "float" for axis in "xy"}
        | {f"{_TARGET}.pose.orientation.{axis}": "float" for axis in "xyzw"},
    ),
    "actionlib_msgs/msg/GoalID": Kind(lambda message: CancelRecord(message.id), {"id": "string"}),
    "nav_msgs/msg/Odometry": Kind(
        _velocity,
        STAMP | {f"twist.twist.{name}": "float" for name in ("linear.x", "linear.y", "angular.z")},
    ),
    "sensor_msgs/msg/Image": Kind(_depth, STAMP | _BYTES | {"encoding": "string", "step": "int"}),
    "sensor_msgs/msg/CameraInfo": Kind(_optics, STAMP | {"width": "int", "height": "int"}),
    "sensor_msgs/msg/PointCloud2": Kind(
        _cloud,
        STAMP
        | {key: kind for key, kind in _BYTES.items() if key != "is_bigendian"}
        | {"fields[].name": "string", "fields[].offset": "int", "fields[].datatype": "int"}
        | {"point_step": "int", "row_step": "int"},
    ),
    "sensor_msgs/msg/Range": Kind(
        _range, STAMP | dict.fromkeys(("range", "min_range", "max_range", "field_of_view"), "float")
    ),
}
