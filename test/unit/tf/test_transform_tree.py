"""tf kept without ROS (against tf2 itself: test/ros/runtime/test_transform_tree_as_tf2.py)."""

from __future__ import annotations

import math

import pytest

from rosbot_patrol.errors import TransformError, TransformNotYet, TransformTooOld
from rosbot_patrol.geometry import Pose2D, compose, invert, quaternion_from_yaw
from rosbot_patrol.tf.tree import Edge, TransformTree

ORIGIN = Pose2D()


def edge(parent: str, child: str, stamp: float = 0.0, pose: Pose2D = ORIGIN, z: float = 0.0) -> Edge:
    return Edge(parent, child, stamp, pose.x, pose.y, z, *quaternion_from_yaw(pose.yaw))


def driven(*stamps: float) -> TransformTree:
    """A robot that drives at 1 m/s and turns at 0.1 rad/s, with a laser at (0.1, 0)."""
    tree = TransformTree()
    tree.add(edge("base_link", "laser", pose=Pose2D(0.1, 0.0, 0.0)), is_static=True)
    for stamp in stamps:
        tree.add(edge("odom", "base_link", stamp, Pose2D(stamp, 0.0, 0.1 * stamp)))
    return tree


def test_between_two_stamps_place_and_turn_are_interpolated() -> None:
    assert driven(1.0, 2.0).lookup("odom", "base_link", 1.25) == pytest.approx((1.25, 0.0, 0.125))


def test_the_shortest_arc_is_taken_over_half_a_turn() -> None:
    tree = TransformTree()
    tree.add(edge("odom", "base_link", 1.0, Pose2D(0.0, 0.0, math.pi - 0.1)))
    tree.add(edge("odom", "base_link", 2.0, Pose2D(0.0, 0.0, -math.pi + 0.3)))
    assert tree.lookup("odom", "base_link", 1.5).yaw == pytest.approx(-math.pi + 0.1)
    assert tree.lookup("odom", "base_link", 1.25).yaw == pytest.approx(math.pi)


def test_chains_up_down_and_across() -> None:
    tree = driven(1.0, 2.0)
    tree.add(edge("odom", "beacon", pose=Pose2D(0.0, 5.0, 1.0)), is_static=True)
    odom_from_laser = compose(Pose2D(1.5, 0.0, 0.15), Pose2D(0.1, 0.0, 0.0))
    assert tree.lookup("odom", "laser", 1.5) == pytest.approx(odom_from_laser)
    assert tree.lookup("laser", "odom", 1.5) == pytest.approx(invert(odom_from_laser))
    beacon_from_laser = compose(invert(Pose2D(0.0, 5.0, 1.0)), odom_from_laser)
    assert tree.lookup("beacon", "laser", 1.5) == pytest.approx(beacon_from_laser)
    assert tree.lookup("odom", "odom", 99.0) == Pose2D()


def test_without_a_time_the_newest_that_all_know_is_taken() -> None:
    tree = driven(1.0, 2.0)
    assert tree.lookup("odom", "laser").x == pytest.approx(2.0 + 0.1 * math.cos(0.2))
    tree.add(edge("map", "odom", 1.0, Pose2D(10.0, 0.0, 0.0)))
    tree.add(edge("map", "odom", 1.5, Pose2D(20.0, 0.0, 0.0)))
    assert tree.lookup("map", "base_link").x == pytest.approx(21.5)
    assert tree.lookup("base_link", "laser") == pytest.approx((0.1, 0.0, 0.0))


def test_not_yet_and_never_are_told_apart() -> None:
    tree = driven(1.0, 2.0)
    with pytest.raises(TransformNotYet, match=r"'base_link' is known from 1.000 to 2.000 s, not at 2.500 s"):
        tree.transform("odom", "laser", 2.5)
    with pytest.raises(TransformTooOld, match=r"not at 0\.500 s"):
        tree.transform("odom", "laser", 0.5)
    with pytest.raises(TransformNotYet, match="nothing was told of the frame 'camera'"):
        tree.transform("odom", "camera", 1.5)
    tree.add(edge("wall", "camera", 1.5))
    with pytest.raises(TransformNotYet, match="not connected"):
        tree.transform("odom", "camera", 1.5)


def test_what_is_older_than_the_cache_is_forgotten() -> None:
    tree = driven(1.0, 2.0, 11.5)
    with pytest.raises(TransformTooOld):
        tree.transform("odom", "base_link", 1.4)
    assert tree.lookup("odom", "base_link", 2.0).x == 2.0
    assert "older than all" in tree.add(edge("odom", "base_link", 1.0))
    assert tree.lookup("odom", "laser", 2.0).x > 2.0  # the static one has no age


def test_late_ones_are_sorted_in_and_a_second_of_one_time_is_left_out() -> None:
    tree = driven(1.0, 3.0, 2.0)
    assert tree.lookup("odom", "base_link", 2.5).x == pytest.approx(2.5)
    assert "of that time already" in tree.add(edge("odom", "base_link", 2.0, Pose2D(9.0, 0.0, 0.0)))
    assert tree.lookup("odom", "base_link", 2.0).x == 2.0


def test_a_new_parent_is_not_interpolated_with_the_old() -> None:
    tree = driven(1.0)
    tree.add(edge("odom2", "base_link", 2.0, Pose2D(7.0, 0.0, 0.0)))
    assert tree.lookup("odom", "base_link", 1.9).x == 1.0
    assert tree.lookup("odom2", "base_link", 2.0).x == 7.0


def test_leading_slashes_do_not_count() -> None:
    tree = TransformTree()
    tree.add(edge("/odom", "/base_link", 1.0, Pose2D(4.0, 0.0, 0.0)))
    assert tree.lookup("odom", "/base_link", 1.0).x == 4.0


def test_a_clock_that_went_back_forgets_what_moves() -> None:
    tree = driven(100.0)
    tree.clear()
    tree.add(edge("odom", "base_link", 1.0, Pose2D(4.0, 0.0, 0.0)))
    assert tree.lookup("odom", "laser", 1.0).x == pytest.approx(4.1)


def test_transforms_that_make_no_sense_are_left_out() -> None:
    tree = TransformTree()
    assert "no name" in tree.add(edge("", "base_link"))
    assert "its own parent" in tree.add(edge("base_link", "/base_link"))
    assert "makes no sense" in tree.add(edge("odom", "base_link", 1.0, Pose2D(math.nan, 0.0, 0.0)))
    assert "makes no sense" in tree.add(Edge("odom", "base_link", 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5))


def test_a_loop_of_frames_is_a_sentence() -> None:
    tree = TransformTree()
    tree.add(edge("a", "b", 1.0))
    tree.add(edge("b", "a", 1.0))
    with pytest.raises(TransformError):
        tree.transform("odom", "a", 1.0)
    with pytest.raises(TransformError):
        tree.transform("odom", "a")
