"""What the messages that move_base hears become: plain records that know no ROS."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rosbot_patrol.geometry import Pose2D, Twist2D, yaw_from_quaternion
from rosbot_patrol.replay.bags import records
from rosbot_patrol.replay.bags.definitions import STAMP
from rosbot_patrol.replay.bags.records import Kind, Refused

LEVEL = 1e-3  # so far the goal's z axis may lean from the vertical, as a cosine


class GoalPoseRecord(NamedTuple):
    """move_base_msgs/MoveBaseActionGoal: id, frame and pose."""

    goal: str
    frame: str
    pose: Pose2D


class CancelRecord(NamedTuple):
    """actionlib_msgs/GoalID on move_base/cancel: id of the goal, "" for all."""

    goal: str


class VelocityRecord(NamedTuple):
    """nav_msgs/Odometry: how the robot moves."""

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


_TARGET = "goal.target_pose"

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
}
