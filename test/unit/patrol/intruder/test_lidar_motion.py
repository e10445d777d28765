"""What moves and is not on the map, with scans cast over a drawn map."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floors import TWO_ROOMS, drawn_floor, scan_over

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.intruder.lidar_motion import LidarMotion, groups, off_the_map

FLOOR = drawn_floor(*TWO_ROOMS)


def play(path, seconds: float = 4.0, *, turning: float = 0.0, drift=lambda t: 0.0, start: float = 10.0) -> LidarMotion:
    """Ten scans a second of things that walk; the robot turns, and its pose is off by a drift of its heading."""
    motion = LidarMotion()
    motion.start()
    for i in range(round(seconds * 10)):
        t = i / 10.0
        true = Pose2D(2.0, 2.0, turning * t)
        motion.see(scan_over(FLOOR, true, start + t, path(t)), Pose2D(2.0, 2.0, true.yaw + drift(t)), FLOOR)
    return motion


@pytest.mark.parametrize("turning", [0.0, 0.75])
def test_somebody_who_walks_has_moved_whether_the_robot_turns_or_not(turning: float) -> None:
    motion = play(lambda t: [(3.5, 0.8 + 0.5 * t, 0.12)], turning=turning)
    assert motion.moved is not None
    assert motion.moved.far > 1.0
    assert (motion.moved.x, motion.moved.y) == pytest.approx((3.4, 2.6), abs=0.4)
    assert motion.text().startswith("something moved by")


def test_a_chair_that_was_pushed_aside_has_not() -> None:
    assert play(lambda t: [(3.4, 1.2, 0.2), (1.2, 3.0, 0.1)], turning=0.75, seconds=9.0).moved is None


def test_a_heading_that_wanders_moves_nothing() -> None:
    motion = play(lambda t: [(3.4, 1.2, 0.2)], turning=0.75, seconds=8.0, drift=lambda t: 0.06 * math.sin(2 * t))
    assert motion.moved is None


def test_an_empty_room_has_nothing_that_moves() -> None:
    assert play(lambda t: [], turning=0.75, seconds=8.0).text() == ""


def test_a_robot_that_is_lost_tells_nothing() -> None:
    motion = LidarMotion()
    for i in range(20):
        scan = scan_over(FLOOR, Pose2D(2.0, 2.0, 0.0), i / 10.0, [(3.5, 1.0 + 0.05 * i, 0.12)])
        motion.see(scan, Pose2D(6.4, 2.2, 0.7 + 0.02 * i), FLOOR)
    assert motion.moved is None


def test_points_on_open_floor_are_off_the_map() -> None:
    points = np.array([[2.0, 2.0], [0.55, 2.0], [4.74, 3.5], [-3.0, 1.0]])
    assert off_the_map(FLOOR, points, 0.3).tolist() == [[2.0, 2.0]]
    assert len(off_the_map(FLOOR, np.empty((0, 2)), 0.3)) == 0


def test_points_that_are_near_are_one_group() -> None:
    chain = np.array([[0.0, 0.0], [0.3, 0.0], [0.6, 0.0], [2.0, 0.0], [2.1, 0.0]])
    assert [len(group) for group in groups(chain, 0.4, 2)] == [3, 2]
    assert [len(group) for group in groups(chain, 0.4, 3)] == [3]
    assert groups(np.empty((0, 2)), 0.4, 1) == []
