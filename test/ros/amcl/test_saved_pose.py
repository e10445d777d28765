"""What a respawned amcl makes of the pose that was saved, without a master."""

from dataclasses import replace

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.amcl import saved_pose
from rosbot_patrol.ros.amcl.saved_pose import NAMES, SavedPose

VALUES = (1.0, 2.0, 0.5, 0.01, 0.02, 0.003)
THERE = Pose2D(7.0, -3.0, 1.0)


@pytest.fixture
def server(monkeypatch):
    """The parameter server."""
    tree = {}
    monkeypatch.setattr(saved_pose.rospy, "get_param", tree.get)
    monkeypatch.setattr(saved_pose.rospy, "set_param", tree.__setitem__)
    monkeypatch.setattr(saved_pose.rospy, "resolve_name", lambda name: name)
    return tree


def respawned(server):
    """A first amcl saves; a second one starts with what it finds."""
    SavedPose().save(VALUES, 100.0, THERE)
    return SavedPose(), AmclParams(**{name: server[f"~{name}"] for name in NAMES})


def test_the_way_since_is_added_where_the_pose_is_the_saved_one(server):
    saved, params = respawned(server)
    assert saved.own(params, 104.0) is None
    assert saved.odometry(params, Pose2D(7.5, -3.0, 2.0)) == THERE


def test_an_odometry_that_began_anew_is_not_a_way(server):
    saved, params = respawned(server)
    assert saved.odometry(params, Pose2D()) is None


def test_a_pose_that_a_launch_file_has_set_since_has_no_odometry(server):
    saved, params = respawned(server)
    assert saved.odometry(replace(params, initial_pose_x=4.0), THERE) is None


def test_another_runs_pose_is_given_up_and_what_was_set_since_stays(server):
    saved, params = respawned(server)
    own = saved.own(replace(params, initial_pose_y=9.0), 3.0)
    assert (own.initial_pose_x, own.initial_pose_y, own.initial_pose_a) == (0.0, 9.0, 0.0)


@pytest.mark.parametrize("tree", [None, 5, {"stamp": "x"}, {"stamp": 1.0}])
def test_what_is_not_ours_is_left_out(server, tree):
    server["~saved_pose"] = tree
    saved = SavedPose()
    assert saved.own(AmclParams(), 0.0) is None
    assert saved.odometry(AmclParams(), Pose2D()) is None
