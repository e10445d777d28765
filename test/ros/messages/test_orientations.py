"""Messages as Python makes them, with a quaternion of zeros, in every reader of an orientation; no master."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped, Quaternion
from nav_msgs.msg import OccupancyGrid, Odometry

from rosbot_patrol.errors import MapError, TransformError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map, write_map
from rosbot_patrol.navigation.interfaces import BAD_QUATERNION
from rosbot_patrol.ros.amcl import node as amcl_node
from rosbot_patrol.ros.messages import convert
from rosbot_patrol.ros.move_base.goals import GoalRefusedError, read_goal, read_pose

NOT_FINITE = Quaternion(0.0, 0.0, math.nan, 1.0)
TWICE = Quaternion(0.0, 0.0, 2.0, 2.0)  # of length 2.8: a quarter turn


def grid_message(orientation=None):
    message = OccupancyGrid()
    message.info.resolution, message.info.width, message.info.height = 0.05, 3, 2
    message.info.origin.position.x = -1.0
    message.info.origin.orientation = orientation or Quaternion()
    message.data = [0, 100, -1, 0, 0, 0]
    return message


def goal_message(orientation=None):
    message = PoseStamped()
    message.header.frame_id = "map"
    message.pose.position.x = 2.0
    message.pose.orientation = orientation or Quaternion()
    return message


def test_a_map():
    info = convert.grid_from_msg(grid_message(), "/map").info
    assert (info.origin_x, info.yaw) == (-1.0, 0.0)
    assert convert.grid_from_msg(grid_message(TWICE), "/map").info.yaw == pytest.approx(math.pi / 2)
    with pytest.raises(MapError, match=r"/map.*is no orientation"):
        convert.grid_from_msg(grid_message(NOT_FINITE), "/map")


def test_a_map_is_saved_with_yaw_0(tmp_path):
    _, text = write_map(tmp_path / "saved", convert.grid_from_msg(grid_message(), "/map"))
    assert "origin: [-1.000000, 0.000000, 0.000000]" in text.read_text()
    assert read_map(text).info.yaw == 0.0


def test_odometry_and_poses():
    assert convert.odometry_from_msg(Odometry())[0] == Pose2D()
    assert convert.pose2d_from_pose(Pose()) == Pose2D()
    assert convert.pose_from_msg(goal_message())[0] == Pose2D(2.0, 0.0, 0.0)


def test_an_initial_pose(monkeypatch):
    monkeypatch.setattr(amcl_node, "now", lambda: 0.0)
    core = SimpleNamespace(hear_initial_pose=lambda record, _now: placed.append(record.pose))
    node = SimpleNamespace(_core=core)
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.pose.covariance = np.diag([0.25, 0.25, 0.0, 0.0, 0.0, 0.1]).ravel()
    placed: list[Pose2D] = []
    for orientation, expected in ((Quaternion(), [Pose2D()]), (NOT_FINITE, [])):
        placed.clear()
        message.pose.pose.orientation = orientation
        amcl_node.AmclNode._initial_pose(node, message)
        assert placed == expected


def fail_to_look_up(target, source, stamp=None):
    raise TransformError(target, source, "no tf")


def test_make_plan_takes_what_upstreams_takes():
    assert read_pose(goal_message(), "map", SimpleNamespace()) == Pose2D(2.0, 0.0, 0.0)
    assert read_pose(goal_message(TWICE), "map", SimpleNamespace()).yaw == pytest.approx(math.pi / 2)
    with pytest.raises(GoalRefusedError, match="is no orientation"):
        read_pose(goal_message(NOT_FINITE), "map", SimpleNamespace())
    with pytest.raises(GoalRefusedError, match="must be in the odom frame"):
        read_pose(goal_message(), "odom", SimpleNamespace(lookup=fail_to_look_up))


def test_a_goal_is_refused_as_upstream_does():
    for orientation in (Quaternion(), NOT_FINITE, Quaternion(1.0, 0.0, 0.0, 0.0)):
        with pytest.raises(GoalRefusedError, match=BAD_QUATERNION):
            read_goal(goal_message(orientation), "map", SimpleNamespace())
    assert read_goal(goal_message(TWICE), "map", SimpleNamespace()).yaw == pytest.approx(math.pi / 2)
